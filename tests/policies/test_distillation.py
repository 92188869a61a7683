"""ManiCM: its steps and its loss by hand, and a teacher whose probability flow is known."""

import numpy as np
import pytest
import torch

from genpolicy.errors import ConfigError
from genpolicy.policies.checkpoint import load_checkpoint
from genpolicy.policies.distillation import (
    CLEAN,
    GRID_STEPS,
    Distillation,
    boundary_gains,
    clean_end,
    ddim_step,
    grid_levels,
    sample_multistep,
    visited_levels,
)
from genpolicy.policies.methods import METHODS, check_sampler
from genpolicy.policies.objectives import Batch
from genpolicy.policies.predictions import PREDICTIONS
from genpolicy.policies.samplers import CountedNetwork
from genpolicy.policies.schedules import squared_cosine
from genpolicy.policies.settings import HeadConfig, SamplerConfig

SCHEDULE = squared_cosine(100)
KINDS = list(PREDICTIONS)


class Told(torch.nn.Module):
    """A network that is a function of chunks and times; counts by whether there is a gradient."""

    def __init__(self, function):
        super().__init__()
        self.function, self.asked = function, []
        self.offset = torch.nn.Parameter(torch.zeros((), dtype=torch.float64))

    def encode(self, observations):
        return observations

    def evaluate(self, condition, values, time):
        self.asked.append((values.detach(), time, torch.is_grad_enabled()))
        return self.function(values, time) + self.offset


def taught(teacher, student, *, prediction="noise"):
    """An objective whose target starts as another function than the student."""
    objective = Distillation(None, None, HeadConfig(prediction=prediction))
    objective.teacher, objective.target = teacher, student
    return objective


def gaussian(kind, *, mean, std):
    """What a perfectly trained teacher says where clean numbers are normal, as a function."""

    def say(x, time):
        kept = SCHEDULE.kept(time.double())[:, None, None]
        spread = kept * std**2 + 1.0 - kept
        clean = mean + kept.sqrt() * std**2 / spread * (x - kept.sqrt() * mean)
        noise = (x - kept.sqrt() * clean) / (1.0 - kept).sqrt()
        return PREDICTIONS[kind].target(clean, noise, kept)

    return say


def along_the_flow(x, now, after, *, mean, std):
    """Exact end of the probability flow of normal data: the standardised number is kept."""
    before, behind = (np.sqrt(kept * std**2 + 1.0 - kept) for kept in (now, after))
    return np.sqrt(after) * mean + behind / before * (x - np.sqrt(now) * mean)


def rows_at(level, count=7):
    generator = torch.Generator().manual_seed(5)
    x = torch.randn(count, 4, 2, generator=generator, dtype=torch.float64)
    return x, torch.full((count,), level)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("level", "after"), [(99, 89), (49, 39), (9, CLEAN)])
def test_the_teacher_s_step_by_hand_whatever_it_predicts(kind, level, after):
    """Plain numbers: the clean estimate, the noise that it leaves, and both shares of the next."""
    mean, std = 0.2, 0.1
    objective = taught(Told(gaussian(kind, mean=mean, std=std)), None, prediction=kind)
    x, levels = rows_at(level)
    found = objective.teacher_step(x, x, level=levels, after=torch.full_like(levels, after)).numpy()
    now, then = SCHEDULE.alpha_bar[level], 1.0 if after == CLEAN else SCHEDULE.alpha_bar[after]
    spread = now * std**2 + 1.0 - now
    clean = mean + np.sqrt(now) * std**2 / spread * (x.numpy() - np.sqrt(now) * mean)
    noise = (x.numpy() - np.sqrt(now) * clean) / np.sqrt(1.0 - now)
    expected = np.sqrt(then) * clean + np.sqrt(1.0 - then) * noise
    assert found == pytest.approx(expected, abs=1e-6)
    if after == CLEAN:
        assert found == pytest.approx(clean, abs=1e-6)


def test_a_clean_estimate_in_the_place_of_the_noise_is_another_step():
    """The original's mistake, injected: its teacher says x0, and its step asks for noise."""
    x, levels = rows_at(49)
    after, said = torch.full_like(levels, 39), Told(gaussian("x0", mean=0.2, std=0.1))
    right, wrong = (
        taught(said, None, prediction=kind).teacher_step(x, x, level=levels, after=after)
        for kind in ("x0", "noise")
    )
    assert float((right - wrong).abs().min()) > 0.01


@pytest.mark.parametrize("kind", KINDS)
def test_shorter_steps_of_an_exact_teacher_follow_its_probability_flow(kind):
    """Order of one step, measured: halving it quarters the error."""
    mean, std = 0.1, 0.2
    x, _ = rows_at(60)
    errors = []
    for steps in (16, 8, 4):
        now, after = SCHEDULE.alpha_bar[60], SCHEDULE.alpha_bar[60 - steps]
        time = torch.full((len(x),), 0.6, dtype=torch.float64)
        said = gaussian(kind, mean=mean, std=std)(x, time)
        clean = PREDICTIONS[kind].clean(x, said, float(now))
        found = ddim_step(x, clean, now=float(now), after=float(after)).numpy()
        exact = along_the_flow(x.numpy(), now, after, mean=mean, std=std)
        errors.append(float(np.abs(found - exact).max()))
    assert errors[-1] < 0.02
    assert 3.0 < errors[0] / errors[1] < 6.0 and 3.0 < errors[1] / errors[2] < 6.0


@pytest.mark.parametrize("kind", KINDS)
def test_the_function_is_the_identity_at_the_clean_end_and_the_estimate_at_the_noisy(kind):
    x, levels = rows_at(CLEAN)
    wild = Told(lambda values, time: 100.0 * torch.ones_like(values))

    def network(values, time):
        return wild.evaluate(None, values, time)

    end = clean_end(network, x, levels, schedule=SCHEDULE, prediction=kind)
    assert torch.equal(end, x)
    skip, outer = boundary_gains(torch.tensor([CLEAN, 0, 99]), dtype=torch.float64)
    # by hand: times 0, 10 and 1000 with a spread of 0.5
    assert skip.flatten().tolist() == pytest.approx([1.0, 0.25 / 100.25, 0.25 / 1000000.25])
    assert outer.flatten().tolist() == pytest.approx([0.0, 10 / 100.25**0.5, 1.0], abs=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_the_loss_by_hand(kind):
    """Every window again in plain numbers: teacher's step, target's end, student's end."""
    teacher = Told(gaussian(kind, mean=0.2, std=0.1))
    target, student = (Told(gaussian(kind, mean=m, std=0.3)) for m in (0.1, -0.1))
    objective = taught(teacher, target, prediction=kind)
    clean = torch.full((64, 3, 1), 0.25, dtype=torch.float64)
    weight = torch.ones_like(clean)
    weight[:, 2] = 0.0
    batch = Batch(torch.zeros(64, 2, 3), clean, weight)
    loss = objective.loss(student, batch, torch.Generator().manual_seed(2))
    ((x, time, own),), ((again, _, held),) = student.asked, teacher.asked
    ((further, behind, also_held),) = target.asked
    assert own and not held and not also_held and torch.equal(x, again)
    level = (time * 100).round().long()
    after = torch.tensor([grid_levels(100)[grid_levels(100).index(k) + 1] for k in level.tolist()])
    assert set(level.tolist()) == set(grid_levels(100)[:-1])
    assert torch.equal((behind * 100).round().long(), after.clamp(min=0))
    table = np.append(SCHEDULE.alpha_bar, 1.0)
    now, then = (table[k.numpy()][:, None, None] for k in (level, after))
    said, further_said = teacher.function(x, time).numpy(), target.function(further, behind).numpy()

    def estimate(values, network_said, kept):
        with np.errstate(divide="ignore"):
            return {
                "noise": (values - np.sqrt(1 - kept) * network_said) / np.sqrt(kept),
                "v": np.sqrt(kept) * values - np.sqrt(1 - kept) * network_said,
                "x0": network_said,
            }[kind]

    def end(values, network_said, kept, at):
        t = 10.0 * (at.numpy() + 1)[:, None, None]
        skip, outer = 0.25 / (t**2 + 0.25), t / np.sqrt(t**2 + 0.25)
        return skip * values + outer * estimate(values, network_said, kept)

    guess = np.clip(estimate(x.numpy(), said, now), -1.0, 1.0)
    rest = (x.numpy() - np.sqrt(now) * guess) / np.sqrt(1 - now)
    step = np.sqrt(then) * guess + np.sqrt(1 - then) * rest
    assert further.numpy() == pytest.approx(step, abs=1e-9)
    found = end(x.numpy(), student.function(x, time).numpy(), now, level)
    wanted = end(step, further_said, then, after)
    assert np.array_equal(wanted[after.numpy() == CLEAN], step[after.numpy() == CLEAN])
    expected = np.square(found - wanted)[:, :2].mean()
    assert loss.item() == pytest.approx(expected, rel=1e-9)
    loss.backward()
    assert student.offset.grad is not None
    assert teacher.offset.grad is None and target.offset.grad is None


def test_the_true_end_of_the_flow_has_hardly_any_loss():
    """Consistent but for what the teacher's long steps err; the mean instead has a large one."""
    mean, std = 0.1, 0.3

    def end(x, time):
        kept = SCHEDULE.kept(time.double())[:, None, None].numpy()
        clean = torch.tensor(along_the_flow(x.numpy(), kept, 1.0, mean=mean, std=std))
        skip, outer = boundary_gains((time * 100).round().long(), dtype=torch.float64)
        return (clean - skip * x) / outer

    generator = torch.Generator().manual_seed(3)
    clean = mean + std * torch.randn(4000, 4, 1, generator=generator, dtype=torch.float64)
    batch = Batch(torch.zeros(4000, 2, 3), clean.clamp(-1, 1), torch.ones_like(clean))
    teacher = Told(gaussian("x0", mean=mean, std=std))
    found = {
        name: taught(teacher, network, prediction="x0")
        .loss(network, batch, torch.Generator().manual_seed(2))
        .item()
        for name, network in (("flow", Told(end)), ("mean", teacher))
    }
    assert found["flow"] < 1e-3
    assert found["mean"] > 3.0 * found["flow"]


def test_a_sampler_visits_the_grid_and_draws_fresh_noise_for_each_jump():
    assert grid_levels(100) == [99, 89, 79, 69, 59, 49, 39, 29, 19, 9, CLEAN]
    assert visited_levels(100, 1) == [99]
    assert visited_levels(100, 2) == [99, 49]
    assert all(set(visited_levels(100, n)) <= set(grid_levels(100)) for n in range(1, 11))
    drawn = []

    def noise(step):
        drawn.append(step)
        return torch.full((3, 4, 2), 1.0 + step, dtype=torch.float64)

    asked = []

    def network(x, time):
        asked.append((x, round(float(time[0]) * 100)))
        return torch.full_like(x, 0.5 * len(asked))

    sampler = SamplerConfig(name="multistep_consistency", steps=2, clip=0.75)
    counted = CountedNetwork(network)
    chunks = sample_multistep(counted, noise, schedule=SCHEDULE, sampler=sampler, prediction="x0")
    assert counted.nfe == 2 and drawn == [0, 1]
    assert [level for _, level in asked] == [99, 49]
    kept = SCHEDULE.alpha_bar[49]
    # by hand: the first end is 0.5 but for what the boundary leaves of the noise; the last is cut
    assert asked[1][0].flatten()[0].item() == pytest.approx(
        0.5 * kept**0.5 + 2.0 * (1 - kept) ** 0.5, abs=1e-4
    )
    assert torch.equal(chunks, torch.full_like(chunks, 0.75))


def test_the_evaluations_of_an_update_are_counted(folders, two_mode_windows):
    """What the record multiplies, counted at the networks."""
    teacher, student = (load_checkpoint(folders[name]).network for name in ("diffusion", "manicm"))
    objective = Distillation(student.dimensions, None, HeadConfig())
    objective.learn_from(teacher, student)
    calls = []
    for network in (objective.teacher, objective.target, student):
        evaluate = network.evaluate

        def counting(condition, values, time, evaluate=evaluate):
            calls.append((len(values), torch.is_grad_enabled()))
            return evaluate(condition, values, time)

        network.evaluate = counting
    windows = two_mode_windows(64)
    batch = Batch(
        torch.tensor(windows.observations, dtype=torch.float32),
        torch.tensor(windows.actions, dtype=torch.float32),
        torch.ones(64, 4, 1),
    )
    objective.loss(student, batch, torch.Generator().manual_seed(1)).backward()
    assert sorted(calls) == [(64, False), (64, False), (64, True)]
    moved = [part.grad is not None for part in student.parameters()]
    assert all(moved)
    assert all(p.grad is None for p in objective.parameters())
    before = [p.clone() for p in objective.target.parameters()]
    with torch.no_grad():
        for part in student.parameters():
            part.add_(1.0)
        objective.updated(student)
    for old, new in zip(before, objective.target.parameters(), strict=True):
        assert torch.allclose(new - old, torch.full_like(old, 0.05), atol=1e-5)


def test_a_student_starts_as_its_teacher(folders):
    teacher = load_checkpoint(folders["diffusion"]).network
    student = load_checkpoint(folders["manicm"]).network
    objective = Distillation(student.dimensions, None, HeadConfig())
    objective.learn_from(teacher, student)
    for own, given in zip(student.parameters(), teacher.parameters(), strict=True):
        assert torch.equal(own, given)
    assert not any(part.requires_grad for part in objective.parameters())


def test_fewer_levels_than_the_grid_are_refused():
    head = HeadConfig(diffusion_levels=GRID_STEPS - 1)
    with pytest.raises(ConfigError, match="levels of the training"):
        check_sampler(METHODS["manicm"], SamplerConfig(name="multistep_consistency"), head)
