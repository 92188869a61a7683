"""The commands of a proposal: units that partners tell, rotations left alone, what is said."""

import numpy as np
from scipy.spatial.transform import Rotation

from genpolicy.data.formats.commanding import propose_commands
from genpolicy.data.formats.sample import Sample, action_of, channels_of
from genpolicy.data.formats.source import Column, RawEpisode

RATE_HZ = 20.0


def episodes(written, *, quaternion=False):
    """Six episodes of a hand that follows places a row later; `written` makes them an action."""
    raw = []
    for number in range(6):
        rng = np.random.default_rng(number)
        times = np.linspace(0, 1, 60)[:, None]
        path = rng.uniform(-0.2, 0.2, 3) + rng.uniform(-0.3, 0.3, 3) * times**2 * (3 - 2 * times)
        seen = np.concatenate([path[:1], path[:-1]])
        columns = {"state": seen, "action": written(path)}
        if quaternion:
            ways = np.concatenate([times, times**2, np.sin(5.0 * times)], axis=1)
            turn = Rotation.from_rotvec(ways * rng.normal(0, 0.5, 3))
            columns["quat"] = turn.as_quat() * rng.choice([-1, 1])
            steps = (turn[1:] * turn[:-1].inv()).as_rotvec()
            turned = np.concatenate([steps, np.zeros((1, 3))]) / 0.1
            columns["action"] = np.concatenate([columns["action"], turned], axis=1)
        raw.append(RawEpisode(str(number), "0", columns))
    return Sample(raw, np.repeat(np.arange(6), 60))


def proposed(sample, names=(), state=("hand_x", "hand_y", "hand_z")):
    width = sample.episodes[0].columns["action"].shape[1]
    told = action_of([Column("action", width, components=tuple(names))], sample, [])
    observed = [Column("state", 3, components=tuple(state))]
    observed += [Column("quat", 4)] if "quat" in sample.episodes[0].columns else []
    channels = channels_of(observed, sample, [])
    return propose_commands(channels, told, sample, period_s=1.0 / RATE_HZ)


def change(path):
    return np.diff(path, axis=0, append=path[-1:])


def test_partners_tell_the_unit_of_what_has_none():
    plain = proposed(episodes(lambda path: path))
    assert plain.action.units == ["m"] * 3 and plain.by_numbers
    assert list((plain.pairing or {}).values()) == [f"state_m.hand_{axis}" for axis in "xyz"]
    assert proposed(episodes(change)).action.units == ["m"] * 3
    assert proposed(episodes(lambda p: change(p) * RATE_HZ)).action.units == ["m/s"] * 3
    assert proposed(episodes(lambda p: change(p) / 0.02)).action.units == ["unknown"] * 3


def test_a_guess_from_the_range_does_not_win_over_what_follows():
    """Named like lengths, a normalised change is none."""
    found = proposed(episodes(lambda p: change(p) / 0.02), names=("hand_x", "hand_y", "hand_z"))
    assert found.action.units == ["unknown"] * 3
    assert not found.by_numbers
    assert {form.form for form in found.forms.values()} == {"change"}


def test_parts_of_a_rotation_are_no_partners_and_turns_are_changes():
    found = proposed(episodes(change, quaternion=True))
    assert set(found.forms) == {f"action_{k}" for k in range(6)}
    assert not any("quat" in seen for seen in (found.pairing or {}).values())
    assert len(found.pairing or {}) == 3
    for name in ("action_3", "action_4", "action_5"):
        assert found.forms[name].form == "change"
        assert abs(found.forms[name].gain - 0.1) < 0.01


def test_a_commanded_quaternion_is_a_place_whatever_its_parts_seem_to_change():
    def written(path):
        # One part grows as fast as the hand goes: it would be read as its speed.
        speed = np.diff(path[:, 0], prepend=path[0, 0]) / 0.05
        return np.concatenate(
            [path, Rotation.from_rotvec(speed[:, None] * [1.0, 0, 0]).as_quat()], 1
        )

    found = proposed(episodes(written))
    assert [found.forms[f"action_{k}"].is_plain for k in range(3, 7)] == [True] * 4
    assert not {f"action_{k}" for k in range(3, 7)} & set(found.pairing)


def test_contradictions_are_said():
    swapped = proposed(episodes(lambda p: p[:, [1, 0, 2]]), names=("hand_x", "hand_y", "hand_z"))
    assert any("Names and numbers contradict: state_m.hand_y answers hand_x" in note
               for note in swapped.notes)  # fmt: skip
    strangers = np.random.default_rng(3).normal(0, 0.02, (60, 3)).cumsum(axis=0)
    alone = proposed(
        episodes(lambda path: strangers * np.sign(path[0, 0])), names=("hand_x", "hand_y", "hand_z")
    )
    assert alone.pairing is None
    assert any("Bears the name of what it does not command: hand_x" in n for n in alone.notes)
