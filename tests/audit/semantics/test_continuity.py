"""Time that runs unevenly, stubs, frozen commands."""

from dataclasses import replace

import numpy as np
import pytest
from arms import SETTINGS, arms, parts, rebuilt

from genpolicy.audit.semantics import measure
from genpolicy.seeds import stream


def kinds(data):
    return [finding.kind for finding in measure(data, SETTINGS).findings]


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
