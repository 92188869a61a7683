"""Time that runs unevenly, copies, seams, stubs, frozen commands."""

from dataclasses import replace

import numpy as np
import pytest
from arms import SETTINGS, arms, build, parts, rebuilt, some

from genpolicy.audit.semantics import measure
from genpolicy.seeds import stream


def kinds(data):
    return [finding.kind for finding in measure(data, SETTINGS).findings]


def joined(data, chosen, other):
    commands, seen = parts(data)
    rows = list(zip(commands, seen, strict=True))
    for k in np.flatnonzero(chosen):
        second = other(k) % len(rows)
        commands[k] = np.vstack([rows[k][0], rows[second][0]])
        seen[k] = np.vstack([rows[k][1], rows[second][1]])
    return rebuilt(data, commands, seen)


def copied(data, share, *, late=0, keep=1.0, noise=0.0):
    """A share of the episodes appended again: begun later, cut, with noise."""
    commands, seen = parts(data)
    rng = stream(9, "copied")
    for k in rng.choice(len(commands), round(share * len(commands)), replace=False):
        last = late + int(keep * (len(commands[k]) - late))
        commands.append(commands[k][late:last])
        copy = seen[k][late:last]
        seen.append(copy + noise * rng.normal(size=copy.shape))
    return build(commands, seen, epochs=2, period_s=data.period_s)


@pytest.mark.parametrize(
    "how", [{}, {"late": 5}, {"keep": 0.7}, {"noise": 5e-5}, {"late": 3, "keep": 0.8}]
)
def test_copies_are_named(how):
    found = measure(copied(arms(50), 0.1, **how), SETTINGS)
    assert [finding.kind for finding in found.findings] == ["duplicate"]
    assert "6 of 66 episodes are copies" in found.findings[0].action


def test_a_single_copy_is_a_mishap_and_a_repeated_demonstration_no_copy():
    assert kinds(copied(arms(51), 1 / 60)) == []
    # Sixty noisy demonstrations of one and the same way.
    rng = stream(10, "same")
    command, seen = (part[0] for part in parts(arms(52, noise=0.0)))
    again = [command + 5e-4 * rng.normal(size=command.shape) for _ in range(60)]
    answers = [seen + 5e-4 * rng.normal(size=seen.shape) for _ in range(60)]
    assert kinds(build(again, answers, epochs=2, period_s=0.05)) == []


@pytest.mark.parametrize("share", [0.1, 1.0])
def test_episodes_glued_to_themselves_are_named(share):
    data = arms(53)
    found = kinds(joined(data, some(data, share), lambda k: k))
    assert found and set(found) == {"glued"}


def test_episodes_glued_to_the_next_are_named_and_no_clock():
    data = arms(54)
    found = kinds(joined(data, some(data, 0.3), lambda k: k + 1))
    assert found[0] == "glued" and set(found) <= {"glued", "duplicate"}


def test_a_way_gone_twice_is_not_glued():
    # There and back and there again, with the noise of a hand.
    data = arms(55, rows=(60, 61))
    commands, seen = parts(data)
    rng = stream(11, "twice")

    def twice(part):
        path = np.vstack([part, part[::-1], part])
        return path + 5e-4 * rng.normal(size=path.shape)

    again = rebuilt(data, [twice(c) for c in commands], [twice(s) for s in seen])
    assert "glued" not in kinds(again) and "duplicate" not in kinds(again)


def test_slow_motion_without_noise_does_not_repeat_itself():
    assert kinds(arms(62, noise=0.0, rate_hz=40.0, rows=(300, 320), episodes=20)) == []


def test_stubs_under_success_are_named_and_honest_failures_are_not():
    data = arms(56)
    commands, seen = parts(data)
    for k in (3, 17, 40):
        commands[k], seen[k] = commands[k][:3], seen[k][:3]
    stubs = rebuilt(data, commands, seen)
    assert kinds(stubs) == ["stub"]
    outcome = stubs.episodes.outcome.copy()
    outcome[[3, 17, 40]] = "failure"
    assert kinds(replace(stubs, episodes=replace(stubs.episodes, outcome=outcome))) == []
    commands[3], commands[17] = parts(data)[0][3], parts(data)[0][17]
    seen[3], seen[17] = parts(data)[1][3], parts(data)[1][17]
    lone = measure(rebuilt(data, commands, seen), SETTINGS)
    assert lone.findings == () and "1 of 60 episodes hold no demonstration" in lone.notes[0]


def test_a_constant_command_is_no_demonstration():
    data = arms(57)
    commands, seen = parts(data)
    for k in (5, 25):
        commands[k] = np.repeat(commands[k][:1], len(commands[k]), axis=0)
        seen[k] = np.repeat(seen[k][:1], len(seen[k]), axis=0)
    assert "stub" in kinds(rebuilt(data, commands, seen))


def test_targets_slower_than_rows_are_a_note():
    data = arms(58, lag_s=0.01)
    commands, seen = parts(data)
    held = [c[np.arange(len(c)) // 4 * 4] for c in commands]
    found = measure(rebuilt(data, held, seen), SETTINGS)
    assert any("repeats the one before" in note for note in found.notes)


@pytest.mark.parametrize(
    ("spoil", "kind"),
    [
        (lambda t, rng: t + 0.5 * np.cumsum(rng.random(len(t)) < 0.03), "gaps"),
        (lambda t, rng: t + 0.05 * rng.uniform(-0.45, 0.45, len(t)), "jitter"),
        (lambda t, rng: 1.5 * t, "rate"),
        (lambda t, rng: np.where(np.arange(len(t)) % 50 == 7, t - 0.2, t), "clock"),
    ],
)  # fmt: skip
def test_uneven_time_is_named(spoil, kind):
    data = arms(59)
    times = spoil(data.event_time_s + 100.0 * data.episode, stream(12, "time"))
    found = measure(replace(data, event_time_s=times), SETTINGS)
    assert found.findings[0].kind == kind
    assert kinds(data) == []


def test_a_few_gaps_and_usual_jitter_are_none():
    data = arms(60)
    rng = stream(13, "time")
    times = data.event_time_s + 0.05 * rng.uniform(-0.1, 0.1, len(data.index))
    times += 0.2 * np.cumsum(rng.random(len(times)) < 0.002)
    found = measure(replace(data, event_time_s=times), SETTINGS)
    assert found.findings == () and found.gaps > 0


def test_wandering_starts_are_a_note():
    data = arms(61)
    commands, seen = parts(data)
    away = [0.02 * k for k in range(60)]
    moved = rebuilt(
        data,
        [c + a for c, a in zip(commands, away, strict=True)],
        [s + a for s, a in zip(seen, away, strict=True)],
    )
    found = measure(moved, SETTINGS)
    assert found.findings == () and any("Starts wander" in note for note in found.notes)
