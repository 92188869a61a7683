"""Log-density: mixtures in closed form, total mass, order, the trace, bits, refusals."""

import copy
import itertools
import math

import numpy as np
import pytest
import torch

from genpolicy.errors import ConfigError, ContractError, NonFiniteError
from genpolicy.policies import density
from genpolicy.policies.density import (
    DENSITIES,
    STEPS,
    diffusion_log_density,
    divergence,
    flow_log_density,
    log_density,
)
from genpolicy.policies.methods import METHODS
from genpolicy.policies.policy import load_policy
from genpolicy.policies.schedules import squared_cosine
from genpolicy.policies.training import train

STD = 0.3
# 128 gaps between levels: steps can be halved without moving off the levels.
SCHEDULE = squared_cosine(129)
BLUR = math.sqrt((1.0 - SCHEDULE.alpha_bar[0]) / SCHEDULE.alpha_bar[0])
ONE = ((1.0, 0.4),)
TWO = ((0.7, -0.8), (0.3, 0.9))


def expected(x, modes, signal, noise):
    """E[clean | x] and E[noise | x] of x = signal * clean + noise * z, clean a mixture.

    Each mode is N(centre, STD^2) in every number of the chunk: the velocity and the denoiser that
    training tends to, written down.
    """
    variance = (signal * STD) ** 2 + noise**2
    away = torch.stack([x - signal * centre for _, centre in modes])
    logits = torch.stack([torch.tensor(weight).log() for weight, _ in modes]).to(x)
    logits = logits - away.square().flatten(1).sum(dim=1) / (2.0 * variance)
    share = logits.softmax(dim=0).reshape(-1, 1, 1, 1)
    centres = x.new_tensor([centre for _, centre in modes]).reshape(-1, 1, 1, 1)
    clean = (share * (centres + signal * STD**2 / variance * away)).sum(dim=0)
    return clean, (share * noise / variance * away).sum(dim=0)


def velocity_of(modes):
    def velocity(x, time):
        clean, noise = expected(x, modes, float(time), 1.0 - float(time))
        return clean - noise

    return velocity


def network_of(modes, prediction, schedule=SCHEDULE):
    def network(x, time):
        kept = schedule.alpha_bar[round(float(time) * schedule.levels)]
        signal, deviation = math.sqrt(kept), math.sqrt(1.0 - kept)
        clean, noise = expected(x, modes, signal, deviation)
        v = signal * noise - deviation * clean
        return {"noise": noise, "x0": clean, "v": v}[prediction]

    return network


def closed_form(chunk, modes, blur=0.0):
    """Logarithm of the mixture's density at a chunk."""
    variance = STD**2 + blur**2
    parts = [
        math.log(weight) - float((chunk - centre).square().sum()) / (2.0 * variance)
        for weight, centre in modes
    ]
    largest = max(parts)
    total = largest + math.log(sum(math.exp(part - largest) for part in parts))
    return total - 0.5 * chunk.numel() * math.log(2.0 * math.pi * variance)


def chunk_at(value, shape=(2, 2)):
    tilt = torch.linspace(-0.1, 0.1, math.prod(shape), dtype=torch.float64).reshape(shape)
    return value + tilt


def of_flow(chunk, modes, steps):
    return flow_log_density(velocity_of(modes), chunk, steps=steps)


def of_diffusion(chunk, modes, steps, prediction="v", schedule=SCHEDULE):
    network = network_of(modes, prediction, schedule)
    return diffusion_log_density(
        network, chunk, schedule=schedule, prediction=prediction, steps=steps
    )


def orders(found, exact):
    """Observed order of each halving of the step."""
    errors = [abs(value - exact) for value in found]
    return [math.log2(before / after) for before, after in itertools.pairwise(errors)]


@pytest.mark.parametrize(
    ("modes", "value", "steps", "tolerance"),
    [
        (ONE, 0.4, STEPS, 1e-4),
        (ONE, -0.8, STEPS, 2e-4),
        (TWO, -0.8, STEPS, 1e-4),
        (TWO, 0.9, STEPS, 2e-4),
        # Between the modes neighbouring ways part: twenty nats lower, and less exact.
        (TWO, 0.1, STEPS, 0.7),
        (TWO, 0.1, 48, 1e-3),
    ],
)
def test_the_flow_of_a_known_density_has_that_density(modes, value, steps, tolerance):
    chunk = chunk_at(value)
    exact = closed_form(chunk, modes)
    assert of_flow(chunk, modes, steps) == pytest.approx(exact, abs=tolerance)


@pytest.mark.parametrize(
    ("modes", "value", "steps", "tolerance"),
    [
        (ONE, 0.4, STEPS, 5e-4),
        (ONE, -0.8, STEPS, 3e-3),
        (TWO, -0.8, STEPS, 5e-4),
        (TWO, 0.9, STEPS, 1e-3),
        (TWO, 0.1, STEPS, 0.3),
        (TWO, 0.1, 64, 1e-3),
    ],
)
def test_the_probability_flow_of_a_known_density_has_it_blurred(modes, value, steps, tolerance):
    """A thousandth is left: the noisiest level keeps a two-thousandth of the clean chunk."""
    chunk = chunk_at(value)
    exact = closed_form(chunk, modes, BLUR)
    assert of_diffusion(chunk, modes, steps) == pytest.approx(exact, abs=tolerance)


def test_the_blur_has_an_effect():
    chunk = chunk_at(-0.8)
    assert closed_form(chunk, TWO) - of_diffusion(chunk, TWO, STEPS) > 5e-3


def test_what_the_network_predicts_changes_no_density():
    found = [of_diffusion(chunk_at(0.9), TWO, STEPS, name) for name in ("noise", "v", "x0")]
    assert found[1:] == pytest.approx(found[:-1], abs=1e-9)


@pytest.mark.parametrize(("modes", "value"), [(ONE, 0.1), (TWO, 0.4)])
def test_the_flow_converges_with_the_fourth_order(modes, value):
    chunk = chunk_at(value)
    found = orders([of_flow(chunk, modes, n) for n in (12, 24, 48)], closed_form(chunk, modes))
    assert all(order > 3.5 for order in found), found


@pytest.mark.parametrize(("modes", "value"), [(ONE, 0.1), (TWO, -0.8)])
def test_the_probability_flow_converges_with_the_fourth_order(modes, value):
    """Against its finest steps: the base is off by more than they are."""
    chunk = chunk_at(value)
    found = orders(
        [of_diffusion(chunk, modes, n) for n in (8, 16, 32)], of_diffusion(chunk, modes, 64)
    )
    assert all(order > 3.5 for order in found), found


@pytest.mark.parametrize("levels", [3, 4, 50, 100])
@pytest.mark.parametrize("steps", [1, 5, 12, 1000])
def test_steps_go_over_all_levels_whatever_their_number(levels, steps):
    legs = density._levels(levels, steps)
    assert legs[0][0] == 0 and legs[-1][2] == levels - 1
    assert len(legs) == min(steps, (levels - 1) // 2)
    assert all(a < b < c for a, b, c in legs)
    assert all(before[2] == after[0] for before, after in itertools.pairwise(legs))


def test_a_level_that_is_left_over_costs_little():
    schedule, chunk = squared_cosine(100), chunk_at(-0.8)
    found = [of_diffusion(chunk, TWO, n, schedule=schedule) for n in (STEPS, 49)]
    assert found[0] == pytest.approx(found[1], abs=2e-3)


def curved(x, time):
    """Of no density that anybody knows."""
    return torch.tanh(1.3 * x + time[:, None, None]) + 0.1 * x.sin()


@pytest.mark.parametrize("method", DENSITIES)
def test_the_density_of_any_field_has_the_mass_one(method):
    """On a grid that is finer than it is wide; towards noise the diffusion's must contract."""
    grid = torch.linspace(-7.0, 7.0, 29, dtype=torch.float64)
    found = [
        flow_log_density(curved, point.reshape(1, 1), steps=6)
        if method == "flow"
        else diffusion_log_density(
            lambda x, time: -curved(x, time), point.reshape(1, 1),
            schedule=SCHEDULE, prediction="v", steps=6,
        )
        for point in grid
    ]  # fmt: skip
    assert np.exp(found).sum() * float(grid[1] - grid[0]) == pytest.approx(1.0, abs=1e-3)


@pytest.fixture(scope="module")
def trained(tmp_path_factory, two_mode_windows, request_for):
    """A flow and a diffusion that know two modes, at -1 and at +1."""
    root, windows = tmp_path_factory.mktemp("density"), two_mode_windows()
    for method in DENSITIES:
        train(root / method, request_for(method, updates=600), windows=windows, validation=windows)
    return {method: load_policy(root / method) for method in DENSITIES}


def asked(count):
    """Observations (count, 2, 3), and chunks of either side in turn, (count, 4, 2)."""
    observations = np.random.default_rng(5).normal(0.0, 0.1, (count, 2, 3))
    chunks = np.empty((count, 4, 2))
    chunks[:, :, 0] = np.where(np.arange(count) % 2, 1.0, -1.0)[:, None]
    chunks[:, :, 1] = observations[:, -1, :1] * 3.0
    return observations, chunks


@pytest.mark.parametrize("method", DENSITIES)
def test_the_trace_is_that_of_finite_differences(trained, method):
    network = copy.deepcopy(trained[method].checkpoint.network).double()
    condition = network.encode(torch.zeros(1, 2, 3, dtype=torch.float64))
    x = torch.linspace(-1.0, 1.0, 8, dtype=torch.float64).reshape(1, 4, 2)

    def velocity(values, place):
        return network.evaluate(condition, values, values.new_tensor([place]))

    value, trace = divergence(velocity, x, 0.5)
    step, total = 1e-5, 0.0
    for number in range(x.numel()):
        move = torch.zeros(x.numel(), dtype=torch.float64)
        move[number] = step
        move = move.reshape(x.shape)
        change = velocity(x + move, 0.5) - velocity(x - move, 0.5)
        total += float(change.flatten()[number]) / (2.0 * step)
    torch.testing.assert_close(value, velocity(x, 0.5))
    assert trace == pytest.approx(total, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("method", DENSITIES)
def test_a_trained_head_is_dense_at_its_modes_and_not_between(trained, method):
    observations, chunks = asked(2)
    at_modes = log_density(trained[method], observations, chunks)
    halved = log_density(trained[method], observations, chunks, steps=2 * STEPS)
    chunks[:, :, 0] = 0.0
    between = log_density(trained[method], observations, chunks)
    assert (at_modes > between + 5.0).all(), (at_modes, between)
    assert np.abs(at_modes - halved).max() < 0.5


@pytest.mark.parametrize("method", DENSITIES)
def test_the_bits_depend_on_neither_batch_nor_order_nor_threads(trained, method):
    observations, chunks = asked(5)
    whole = log_density(trained[method], observations, chunks, steps=3)
    order = np.array([3, 0, 4, 2, 1])
    moved = log_density(trained[method], observations[order], chunks[order], steps=3)
    alone = [
        log_density(trained[method], observations[i : i + 1], chunks[i : i + 1], steps=3)[0]
        for i in range(5)
    ]
    threads = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        again = log_density(trained[method], observations, chunks, steps=3)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(threads)
    assert (whole == alone).all() and (whole == again).all() and (whole[order] == moved).all()
    assert next(trained[method].checkpoint.network.parameters()).dtype == torch.float32


@pytest.mark.parametrize("method", sorted(set(METHODS) - set(DENSITIES)))
def test_a_method_that_states_no_density_is_refused(folders, method):
    policy = load_policy(folders[method])
    chunks = np.zeros((1, policy.prediction_horizon, 2))
    with pytest.raises(ConfigError, match=f"log-density is method '{method}', expected one of"):
        log_density(policy, np.zeros((1, 2, 3)), chunks)


def test_chunks_that_cannot_be_are_refused(trained):
    observations, chunks = asked(2)
    with pytest.raises(ContractError, match="one chunk per observation"):
        log_density(trained["flow"], observations, chunks[:1])
    with pytest.raises(ContractError, match="one chunk per observation"):
        log_density(trained["flow"], observations, chunks[:, :3])
    chunks[1, 2, 0] = np.nan
    with pytest.raises(NonFiniteError, match=r"\[1, 2, 0\] is nan"):
        log_density(trained["flow"], observations, chunks)


@pytest.mark.parametrize("method", DENSITIES)
def test_fewer_than_one_step_is_refused(trained, method):
    observations, chunks = asked(1)
    with pytest.raises(ConfigError, match="steps of a log-density is 0, expected at least 1"):
        log_density(trained[method], observations, chunks, steps=0)


def test_two_levels_are_no_way_to_noise():
    with pytest.raises(ConfigError, match=r"head\.diffusion_levels is 2, expected at least 3"):
        of_diffusion(chunk_at(0.1), ONE, 4, schedule=squared_cosine(2))
