"""Flow samplers: their tables, torchdiffeq, order of convergence, an analytic Gaussian, a cap."""

import math

import numpy as np
import pytest
import torch
from torchdiffeq import odeint

from genpolicy.errors import ConfigError, EvaluationCapError
from genpolicy.policies.ode_samplers import (
    ADAPTIVE_TABLEAUS,
    FIXED_TABLEAUS,
    sample_adaptive,
    sample_ode,
)
from genpolicy.policies.samplers import CountedNetwork

MEAN, STD = 0.4, 0.3


def fixed_noise(shape=(5, 4, 3)):
    drawn = torch.randn(shape, generator=torch.Generator().manual_seed(7), dtype=torch.float64)
    return lambda _: drawn


def curved_network(x, time):
    """Bounded, non-linear, time-dependent: any indexing mistake shows."""
    return torch.tanh(1.3 * x + time[:, None, None]) + 0.1 * x.flip(-1)


def gaussian_velocity(x, time):
    """Exact velocity of the straight path to data N(MEAN, STD^2)."""
    t = time[:, None, None]
    variance = t**2 * STD**2 + (1.0 - t) ** 2
    return MEAN + (t * STD**2 - (1.0 - t)) / variance * (x - t * MEAN)


def normal_grid(count=4001):
    """Quantiles of the standard normal: expectations without sampling error."""
    levels = (torch.arange(count, dtype=torch.float64) + 0.5) / count
    return torch.special.ndtri(levels)[:, None, None]


def adaptive(network, noise, *, steps=4, tolerance=1e-4, cap=2000):
    counted = CountedNetwork(network, cap=cap)
    found = sample_adaptive(counted, noise, name="bosh3", steps=steps, tolerance=tolerance)
    return found, counted.nfe


@pytest.mark.parametrize("tableau", [*FIXED_TABLEAUS.values(), *ADAPTIVE_TABLEAUS.values()])
def test_a_table_fulfils_the_conditions_of_its_order(tableau):
    """Row sums are the nodes, and the results integrate t^(q-1) exactly up to their order."""
    rows = [np.array(stage.weights) / stage.divisor for stage in tableau.stages]
    assert np.allclose([0.0, *(row.sum() for row in rows)], tableau.nodes)
    assert [len(row) for row in rows] == list(range(1, len(tableau.nodes)))
    orders = {tableau.result: tableau.order + (tableau.embedded is not None)}
    if tableau.embedded is not None:
        orders[tableau.embedded] = tableau.order
        last = np.array([*tableau.stages[-1].weights, 0]) / tableau.stages[-1].divisor
        result = np.array(tableau.result.weights) / tableau.result.divisor
        assert np.allclose(last, result), "the last slope is reused as the next first one"
    for blend, order in orders.items():
        weights = np.array(blend.weights) / blend.divisor
        for power in range(1, order + 1):
            nodes = np.array(tableau.nodes) ** (power - 1)
            assert weights @ nodes == pytest.approx(1.0 / power)
        matrix = np.zeros((len(weights), len(weights)))
        for row, values in enumerate(rows, start=1):
            matrix[row, : len(values)] = values
        if order >= 3:
            assert weights @ matrix @ np.array(tableau.nodes) == pytest.approx(1.0 / 6.0)


def written_out(name, network, x, steps):
    """The loops as they stood before the tables; every operation in this order."""
    h = 1.0 / steps

    def slope(point, time):
        return network(point, torch.full(point.shape[:1], time, dtype=point.dtype))

    for step in range(steps):
        start = step / steps
        k1 = slope(x, start)
        if name == "euler":
            x = x + h * k1
        elif name == "heun":
            k2 = slope(x + h * k1, start + h)
            x = x + h / 2.0 * (k1 + k2)
        elif name == "midpoint":
            x = x + h * slope(x + h / 2.0 * k1, start + h / 2.0)
        else:
            k2 = slope(x + h / 2.0 * k1, start + h / 2.0)
            k3 = slope(x + h / 2.0 * k2, start + h / 2.0)
            k4 = slope(x + h * k3, start + h)
            x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return x


@pytest.mark.parametrize("steps", [1, 3, 4, 7, 10])
@pytest.mark.parametrize("name", list(FIXED_TABLEAUS))
def test_a_table_gives_the_bytes_of_the_loop_written_out(name, steps):
    start = fixed_noise((16, 16, 10))(0).to(torch.float32)
    found = sample_ode(curved_network, lambda _: start, name=name, steps=steps)
    expected = written_out(name, curved_network, start, steps)
    assert found.numpy().tobytes() == expected.numpy().tobytes()


@pytest.mark.parametrize(
    ("name", "method"), [("euler", "euler"), ("midpoint", "midpoint"), ("rk4", "rk4")]
)
def test_ode_equals_torchdiffeq(name, method):
    noise = fixed_noise()
    steps = 8

    def velocity(time, x):
        return curved_network(x, time.expand(len(x)))

    grid = torch.linspace(0.0, 1.0, steps + 1, dtype=torch.float64)
    if name == "rk4":  # torchdiffeq's rk4 is the 3/8 rule; compare both with a fine solution
        expected = odeint(
            velocity, noise(0), grid[[0, -1]], method="dopri5", rtol=1e-10, atol=1e-10
        )
        found = sample_ode(curved_network, noise, name=name, steps=64)
    else:
        expected = odeint(velocity, noise(0), grid, method=method)
        found = sample_ode(curved_network, noise, name=name, steps=steps)
    assert torch.allclose(found, expected[-1], atol=1e-7)


def test_heun_equals_torchdiffeq():
    noise = fixed_noise()
    grid = torch.linspace(0.0, 1.0, 9, dtype=torch.float64)
    expected = odeint(
        lambda time, x: curved_network(x, time.expand(len(x))), noise(0), grid, method="heun2"
    )
    found = sample_ode(curved_network, noise, name="heun", steps=8)
    assert torch.allclose(found, expected[-1], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "order"), [("euler", 1), ("midpoint", 2), ("heun", 2), ("rk4", 4)]
)
def test_order_of_convergence_is_measured(name, order):
    noise = fixed_noise()
    exact = sample_ode(curved_network, noise, name="rk4", steps=512)
    steps = np.array([8, 16, 32, 64])
    errors = [
        float((sample_ode(curved_network, noise, name=name, steps=int(n)) - exact).abs().max())
        for n in steps
    ]
    slope = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.25)


# Golden: methods.md annex (root mean square distance to the exact map MEAN + STD * noise).
@pytest.mark.parametrize(
    ("name", "steps", "rmse"),
    [
        ("euler", 8, 0.065), ("heun", 4, 0.010), ("rk4", 2, 0.023),
        ("euler", 16, 0.034), ("heun", 8, 0.0045), ("rk4", 4, 0.0006),
    ],
)  # fmt: skip
def test_flow_error_at_equal_nfe(name, steps, rmse):
    grid = normal_grid()
    counted = CountedNetwork(gaussian_velocity)
    samples = sample_ode(counted, lambda _: grid, name=name, steps=steps)
    assert counted.nfe == (
        8 if (steps in (2, 4) and rmse > 0.005) or (name == "euler" and steps == 8) else 16
    )
    error = float((samples - (MEAN + STD * grid)).square().mean().sqrt())
    assert error == pytest.approx(rmse, rel=0.12)


def test_the_error_of_an_adaptive_run_follows_its_tolerance():
    """Each of a dozen and more steps is held below it; the whole falls with it, at order 3."""
    exact = odeint(
        lambda time, x: curved_network(x, time.expand(len(x))), fixed_noise()(0),
        torch.tensor([0.0, 1.0], dtype=torch.float64), method="dopri5", rtol=1e-12, atol=1e-12,
    )[-1]  # fmt: skip
    counts, errors = [], []
    for tolerance in (1e-3, 1e-5, 1e-7):
        found, nfe = adaptive(curved_network, fixed_noise(), tolerance=tolerance)
        counts.append(nfe)
        errors.append(float((found - exact).abs().max()))
        assert errors[-1] < 20.0 * tolerance
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope == pytest.approx(3.0, abs=0.6)


def test_an_adaptive_run_reaches_the_gaussian():
    grid = normal_grid(101)
    found, nfe = adaptive(gaussian_velocity, lambda _: grid, tolerance=1e-5)
    assert float((found - (MEAN + STD * grid)).abs().max()) < 1e-4
    assert nfe < 200


def test_each_row_is_integrated_as_if_alone():
    """One row starts far out, where the flow is stiff; the others neither wait nor move on."""
    start = torch.tensor([[[0.1]], [[-0.7]], [[0.5]]], dtype=torch.float64)
    stiff = torch.tensor([1.0, 1.0, 40.0], dtype=torch.float64)

    def network(rate):
        return lambda x, time: (rate[:, None, None] * (time[:, None, None] * 9.0).sin()) * x.cos()

    together, nfe = adaptive(network(stiff), lambda _: start)
    alone = [
        adaptive(network(stiff[row : row + 1]), lambda _, row=row: start[row : row + 1])
        for row in range(3)
    ]
    for row, (found, _) in enumerate(alone):
        assert torch.equal(found[0], together[row])
    counts = [count for _, count in alone]
    assert nfe == max(counts) == counts[2] > 1.5 * max(counts[:2])


def test_rejected_steps_are_counted():
    """A first step that is too long costs its rejections: three calls each, like any other."""
    times = []

    def network(x, time):
        times.append(float(time[0]))
        return (40.0 * time[:, None, None]).cos() * 8.0 + 0.0 * x

    _, nfe = adaptive(network, lambda _: torch.zeros(1, 1, 1, dtype=torch.float64), steps=1)
    tried = np.reshape(times[1:], (-1, 3))  # at half, three quarters and the end of the step
    lengths = 4.0 * (tried[:, 1] - tried[:, 0])
    starts = tried[:, 2] - lengths
    rejected = np.isclose(np.append(starts[1:], 1.0), starts)
    assert nfe == len(times) == 1 + 3 * len(tried)
    assert rejected[0] and lengths[0] == pytest.approx(1.0)
    assert lengths[~rejected].sum() == pytest.approx(1.0)


def test_a_run_that_does_not_arrive_within_its_cap_is_an_error():
    _, needed = adaptive(curved_network, fixed_noise())
    found, _ = adaptive(curved_network, fixed_noise(), cap=needed)
    assert torch.isfinite(found).all()
    calls = []

    def network(x, time):
        calls.append(1)
        return curved_network(x, time)

    with pytest.raises(EvaluationCapError) as error:
        adaptive(network, fixed_noise(), cap=needed - 1)
    assert len(calls) == needed - 1
    assert error.value.where == "network evaluations of one sample"
    assert error.value.expected == f"at most sampler.nfe_cap, {needed - 1}"
    assert "Reject the chunk and hold" in error.value.action


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_velocity_that_is_no_number_is_never_accepted(value):
    with pytest.raises(EvaluationCapError, match="more than 50"):
        adaptive(lambda x, time: torch.full_like(x, value), fixed_noise(), cap=50)


@pytest.mark.parametrize("name", list(FIXED_TABLEAUS))
def test_nfe_is_counted(name):
    counted = CountedNetwork(curved_network)
    sample_ode(counted, fixed_noise(), name=name, steps=5)
    assert counted.nfe == {"midpoint": 10, "heun": 10, "rk4": 20}.get(name, 5)


def test_no_step_and_unknown_names_are_refused():
    for name, steps in (("euler", 0), ("ddim", 2), ("bosh3", 2)):
        with pytest.raises(ConfigError):
            sample_ode(curved_network, fixed_noise(), name=name, steps=steps)
    counted = CountedNetwork(curved_network, cap=9)
    for name, steps in (("bosh3", 0), ("heun", 2)):
        with pytest.raises(ConfigError):
            sample_adaptive(counted, fixed_noise(), name=name, steps=steps, tolerance=1e-3)
