"""Copies of episodes, and episodes glued to themselves or the next."""

import numpy as np
import pytest
from arms import SETTINGS, arms, build, parts, rebuilt
from joining import copied, joined, kinds

from genpolicy.audit.data import canonical
from genpolicy.audit.semantics import copies, measure
from genpolicy.audit.semantics.motion import make_motion
from genpolicy.seeds import stream


def test_a_single_copy_is_a_mishap_and_a_repeated_demonstration_no_copy():
    assert kinds(copied(arms(51), 1 / 60)) == []
    # Sixty noisy demonstrations of one and the same way.
    rng = stream(10, "same")
    command, seen = (part[0] for part in parts(arms(52, noise=0.0)))
    again = [command + 5e-4 * rng.normal(size=command.shape) for _ in range(60)]
    answers = [seen + 5e-4 * rng.normal(size=seen.shape) for _ in range(60)]
    assert kinds(build(again, answers, epochs=2, period_s=0.05)) == []


ALIKE = {
    "switching": lambda time, at: (time > at).astype(float),
    "smooth": lambda time, at: np.sin(2 * np.pi * (time + at)),
}


@pytest.mark.parametrize("kind", ALIKE)
def test_what_agrees_in_many_columns_and_goes_on_two_sides_is_no_copy(kind):
    """One operator's gripper, phases and height are alike whichever side they pass on."""
    rng = stream(12, "sides")
    time = np.linspace(0.0, 1.0, 90)
    alike = np.column_stack([ALIKE[kind](time, at) for at in np.linspace(0.1, 0.9, 12)])
    commands, seen = [], []
    for number in range(60):
        across = (-1.0) ** number * 0.12 * np.sin(np.pi * time) + 0.0005 * number
        tremor = 3e-4 * rng.normal(size=(90, 3))
        place = np.column_stack([0.3 * time, across, 0.05 * np.cos(np.pi * time)]) + tremor
        commands.append(place)
        seen.append(np.column_stack([place + 3e-5 * rng.normal(size=(90, 3)), alike]))
    data = build(commands, seen, epochs=2, period_s=0.05)
    assert not copies.find_copies(data, make_motion(data)).duplicate.any()
    if kind == "switching":
        twice = copied(data, 0.1)
        found = copies.find_copies(twice, make_motion(twice)).duplicate
        assert np.flatnonzero(found).tolist() == list(range(60, 66))


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


def findings(data):
    return [(found.kind, found.where, found.measured) for found in measure(data, SETTINGS).findings]


@pytest.mark.parametrize("how", ["copied", "late and short", "glued", "as it is"])
def test_what_is_left_out_changes_no_finding(how, monkeypatch):
    data = arms(61)
    if how == "glued":
        data = joined(data, np.arange(len(data.episodes)) % 5 == 0, lambda k: k)
    elif how != "as it is":
        data = copied(data, 0.1, **({"late": 3, "keep": 0.8} if how != "copied" else {}))
    said = findings(canonical(data))
    monkeypatch.setattr(copies, "may_cover", lambda _, __, rows, **___: np.ones(len(rows), bool))
    assert findings(canonical(data)) == said
    assert (how == "as it is") == (said == [])
