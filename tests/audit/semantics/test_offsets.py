"""Offsets in a part of the episodes: named where they are a constant, and nothing else is.

Three numbers go from a home to one of some goals round a corner of its own; what parts the episodes
is planted in what is observed, or in what is commanded.
"""

from dataclasses import replace

import numpy as np
import pytest
from arms import SETTINGS, build
from scipy.ndimage import gaussian_filter1d

from genpolicy.audit.forms import Forms
from genpolicy.audit.semantics import measure
from genpolicy.audit.semantics.calibration import offset_floor
from genpolicy.audit.semantics.following import following
from genpolicy.audit.semantics.motion import make_motion
from genpolicy.audit.semantics.offsets import part_findings
from genpolicy.audit.variable import Variable, numbered
from genpolicy.seeds import stream

EPISODES, PERIOD_S = 80, 0.05
BESIDE = np.array([0.015, -0.01, 0.02])
HEAVY = np.array([0.0, 0.0, -0.03])


def at_rest(u):
    """Begins and ends at rest."""
    return 10 * u**3 - 15 * u**4 + 6 * u**5


def world(seed=1, *, ways=2, along=at_rest, straight=False, rows=(50, 90), spread=0.005):
    """Commands of each episode, the way that it took, and the draws.

    Args:
        seed: Of every draw.
        ways: How many goals, each with a way of its own.
        along: Share of the way at a share of the rows.
        straight: Goes round no corner.
        rows: Least and most rows of an episode, or how many each has.
        spread: Of where they begin.
    """
    rng = stream(seed, "offsets")
    home, via = 0.3 * rng.normal(size=3), 0.15 * rng.normal(size=(ways, 3))
    goal = 0.4 * np.sign(rng.normal(size=3)) + 0.2 * rng.normal(size=(ways, 3))
    way = rng.permutation(np.arange(EPISODES) % ways)
    commands = []
    for episode in range(EPISODES):
        begin = home + spread * rng.normal(size=3)
        end = goal[way[episode]] + 0.005 * rng.normal(size=3)
        corner = (begin + end) / 2 + via[way[episode]] + 0.02 * rng.normal(size=3)
        count = int(rng.integers(*rows)) if len(rows) == 2 else int(rows[episode])
        u = np.linspace(0.0, 1.0, count)
        at = 400 * along(u)
        fine = np.interp(np.arange(401), [0, 200, 400], np.arange(3))
        curve = np.stack(
            [np.interp(fine, np.arange(3), c) for c in np.stack([begin, corner, end], 1)], 1
        )
        if straight:
            curve = begin + np.linspace(0.0, 1.0, 401)[:, None] * (end - begin)
        else:
            curve = gaussian_filter1d(curve, 16, axis=0, mode="nearest")
        commands.append(np.stack([np.interp(at, np.arange(401), c) for c in curve.T], axis=1))
    return commands, way, rng


def answers(commands, lag_rows=2.0, constant_rows=1.5):
    """What an arm that begins at rest does of its commands."""
    seen = []
    for command in commands:
        at = np.arange(len(command))
        late = np.stack([np.interp(at - lag_rows, at, column) for column in command.T], axis=1)
        for row in at[1:]:
            late[row] = late[row - 1] + (late[row] - late[row - 1]) / (1.0 + constant_rows)
        seen.append(late)
    return seen


def shifted(parts, chosen, shift):
    return [part + shift * bool(off) for part, off in zip(parts, chosen, strict=True)]


def part_of(share, seed=2):
    return stream(seed, "part").permutation(EPISODES) < round(share * EPISODES)


def recording(commands, seen):
    noise = stream(3, "noise")
    seen = [part + 5e-4 * noise.normal(size=part.shape) for part in seen]
    return build(commands, seen, epochs=1, period_s=PERIOD_S)


def found(data):
    motion = make_motion(data)
    follows = following(motion, data.period_s, SETTINGS.maximum_lag_rows)
    return part_findings(data, motion, follows, SETTINGS)


def share_of(command):
    """How much of its way lies behind each row."""
    steps = np.linalg.norm(np.diff(command, axis=0, prepend=command[:1]), axis=1)
    return (np.cumsum(steps) / steps.sum())[:, None]


@pytest.mark.parametrize("share", [0.15, 0.3, 0.5])
@pytest.mark.parametrize("ways", [1, 2])
@pytest.mark.parametrize("where", ["seen", "commanded"])
@pytest.mark.parametrize("times", [1.0, 10.0])
def test_an_offset_in_a_part_is_a_calibration_of_these_episodes(share, ways, where, times):
    commands, _, _ = world(ways=ways)
    seen, chosen = answers(commands), part_of(share)
    if where == "seen":
        seen = shifted(seen, chosen, times * BESIDE)
    else:
        commands = shifted(commands, chosen, times * BESIDE)
    data = recording(commands, seen)
    (item,) = measure(data, SETTINGS).findings
    assert (item.kind, item.variable, item.question) == (
        "calibration", "j2", "calibration_residual_m",
    )  # fmt: skip
    assert item.measured == pytest.approx(times * 0.02, rel=0.1)
    assert item.floor == offset_floor(make_motion(data), SETTINGS)
    count = int(np.count_nonzero(chosen))
    named = {f"ep{k:04d}" for k in np.flatnonzero(chosen)}
    named = named if share < 0.5 else named | {f"ep{k:04d}" for k in np.flatnonzero(~chosen)}
    assert f"In {count} of {EPISODES} episodes" in item.action
    assert item.where.split(" and ")[1] == f"{count - 3} more"
    assert set(item.where.split(" and ")[0].split(", ")) <= named


def test_an_offset_is_said_of_one_half_if_both_are_as_large():
    commands, _, _ = world()
    data = recording(commands, shifted(answers(commands), part_of(0.5), BESIDE))
    (item,) = found(data)
    assert f"In {EPISODES // 2} of {EPISODES} episodes" in item.action


def test_the_same_in_all_is_no_offset_of_a_part():
    """A leader's own zero and gain, or a tool of which all know."""
    commands, _, _ = world()
    seen = answers(commands)
    assert found(recording(commands, seen)) == []
    assert found(recording(commands, shifted(seen, np.ones(EPISODES), BESIDE))) == []
    leader = [part * np.array([0.92, 1.08, 1.03]) + 5 * BESIDE for part in commands]
    assert found(recording(leader, seen)) == []


def test_below_the_floor_nothing_is_looked_for():
    commands, _, _ = world(ways=1)
    data = recording(commands, shifted(answers(commands), part_of(0.3), 0.1 * BESIDE))
    assert found(data) == []


def test_a_few_episodes_are_no_part():
    commands, _, _ = world(ways=1)
    chosen = np.arange(EPISODES) < 3
    assert found(recording(commands, shifted(answers(commands), chosen, BESIDE))) == []


def test_a_spring_that_pulls_on_one_way_is_no_calibration():
    """Stiffness that differs by goal: the further, the more."""
    commands, way, _ = world()
    pulled = zip(answers(commands), commands, way, strict=True)
    seen = [part + 3 * BESIDE * share_of(command) * k for part, command, k in pulled]
    assert found(recording(commands, seen)) == []


def test_a_controller_that_gives_in_on_one_way_is_no_calibration():
    """Stiffness that differs by goal: as much all along, and told by the way."""
    commands, way, _ = world()
    assert found(recording(commands, shifted(answers(commands), way, BESIDE))) == []


@pytest.mark.parametrize(
    ("taken", "let_go", "along"),
    [(0.1, 2.0, at_rest), (0.3, 2.0, at_rest), (0.1, 0.9, at_rest), (-1.0, 0.85, at_rest),
     # Cut where it moves: it begins at speed, or ends so.
     (0.1, 2.0, lambda u: 1 - (1 - u) ** 2), (-1.0, 0.93, lambda u: u**2)],
)  # fmt: skip
def test_a_load_of_two_weights_is_no_calibration(taken, let_go, along):
    """Taken up soon or late, brought to an end or let go; whatever the way is."""
    commands, _, _ = world(ways=1, along=along, straight=along is not at_rest)
    sags = []
    done = answers(commands) if along is at_rest else commands
    for part, command, heavy in zip(done, commands, part_of(0.4), strict=True):
        carried = (share_of(command) > taken) & (share_of(command) < let_go)
        sags.append(part + HEAVY * carried * bool(heavy))
    assert found(recording(commands, sags)) == []


def test_what_an_object_explains_is_no_calibration():
    """Held from the first row to the last, a heavy one sags all along."""
    commands, _, _ = world()
    heavy = part_of(0.4)
    data = recording(commands, shifted(answers(commands), heavy, HEAVY))
    assert len(found(data)) == 1
    named = replace(data.episodes, object=np.where(heavy, "iron", "cork"))
    assert found(replace(data, episodes=named)) == []
    other = replace(data.episodes, object=np.where(part_of(0.5, seed=9), "iron", "cork"))
    assert len(found(replace(data, episodes=other))) == 1


@pytest.mark.parametrize("name", ["payload_kg", "info/tool", "impedance.stiffness"])
def test_what_was_mounted_or_carried_explains_under_any_name(name):
    commands, _, _ = world()
    heavy = part_of(0.4)
    data = recording(commands, shifted(answers(commands), heavy, HEAVY))

    def with_column(name, values, **more):
        return replace(data, variables=(Variable(name, values, **more),))

    assert found(with_column(name, np.where(heavy, 1.5, 0.5))) == []
    assert found(with_column(name, numbered(heavy))) == []
    assert len(found(with_column(name, numbered(part_of(0.5, seed=9))))) == 1
    # Whoever was there, and when, may have calibrated anew.
    assert len(found(with_column("variable.batch", numbered(heavy)))) == 1


def test_two_places_to_work_at_are_no_calibration():
    """Away from each other gravity bends an arm otherwise; no pose is in both."""
    commands, _, rng = world(ways=1)
    place = np.array([0.8, -0.5, 0.3])
    commands = shifted(commands, part_of(0.4), place)
    bend = 0.1 * rng.normal(size=(3, 3))
    seen = [part + np.tanh(part) @ bend for part in answers(commands)]
    assert found(recording(commands, seen)) == []


def test_backlash_is_no_calibration():
    commands, _, _ = world()
    seen = [
        part - 0.02 * np.sign(gaussian_filter1d(np.gradient(command, axis=0), 3, axis=0))
        for part, command in zip(answers(commands), commands, strict=True)
    ]
    assert found(recording(commands, seen)) == []


@pytest.mark.parametrize("both", [True, False])
def test_coarse_numbers_are_no_calibration(both):
    commands, _, _ = world()
    coarse = [np.round(part / 0.03) * 0.03 for part in answers(commands)]
    asked = [np.round(part / 0.03) * 0.03 for part in commands] if both else commands
    assert found(recording(asked, coarse)) == []


def test_a_finger_stopped_by_what_it_grasps_is_no_calibration():
    commands, _, _ = world(ways=1)
    seen = answers(commands)
    for command, part, wide in zip(commands, seen, part_of(0.4), strict=True):
        command[:, 2] = np.clip((0.4 - np.linspace(0, 1, len(command))) / 0.1, 0, 1) * 0.08
        part[:, 2] = np.maximum(answers([command])[0][:, 2], 0.06 if wide else 0.03)
    assert found(recording(commands, seen)) == []


def test_a_column_that_stands_is_not_asked():
    """As the hanging arm of the G1: it rests in two ways, and nothing was commanded of it."""
    commands, _, _ = world()
    seen = answers(commands)
    for command, part, hangs in zip(commands, seen, part_of(0.4), strict=True):
        command[:, 2] = 0.1
        part[:, 2] = 0.1 + 0.05 * bool(hangs)
    assert found(recording(commands, seen)) == []


def test_a_column_that_seldom_moves_is_not_asked():
    """As a joint of the G1 that is seen to follow in 17 of 100 episodes, in two clusters."""
    commands, _, _ = world(ways=1)
    for number, command in enumerate(commands):
        command[:, 2] = command[:, 2] if number % 5 == 0 else 0.1
    seen = shifted(answers(commands), np.arange(EPISODES) % 15 == 0, np.array([0.0, 0.0, 0.05]))
    assert found(recording(commands, seen)) == []


@pytest.mark.parametrize("straight", [True, False])
@pytest.mark.parametrize("fast", [1.5, 2.2])
def test_two_paces_of_an_arm_that_never_rests_are_no_calibration(straight, fast):
    """It trails by more the faster it goes, all along."""
    quick = part_of(0.5)
    rows = np.where(quick, 90 / fast, 90)
    commands, _, _ = world(ways=1, straight=straight, along=lambda u: u, rows=rows)
    seen = []
    for command in commands:
        before = command[0] - np.arange(12, 0, -1)[:, None] * (command[1] - command[0])
        whole, at = np.vstack([before, command]), np.arange(len(command)) + 12 - 2.4
        seen.append(np.stack([np.interp(at, np.arange(len(whole)), c) for c in whole.T], axis=1))
    assert found(recording(commands, seen)) == []


def test_what_is_added_up_has_no_place_to_stand_beside():
    """Changes and rates say no place: an offset of either is lost, a stale first row is none."""
    commands, _, _ = world(spread=0.05)
    chosen, forms = (
        part_of(0.3),
        Forms(np.ones(3, dtype=bool), np.ones(3), np.zeros(3), np.arange(3)),
    )
    seen = answers(commands)
    steps = np.vstack([np.diff(part, axis=0, prepend=part[:1]) for part in commands])
    data = recording(commands, shifted(seen, chosen, BESIDE))
    assert found(replace(data, action=steps, forms=forms)) == []
    stale = [
        np.vstack([part[:1] + BESIDE * off, part[1:]])
        for part, off in zip(seen, chosen, strict=True)
    ]
    assert found(replace(recording(commands, stale), action=steps, forms=forms)) == []


def test_another_finding_comes_first():
    """What a lag, a frame or a unit moves stands beside its command for that reason."""
    commands, _, _ = world()
    chosen = part_of(0.3)
    seen = shifted(answers(commands), chosen, BESIDE)
    late = [
        np.vstack([part[:1]] * 6 + [part[:-6]]) if off else part
        for part, off in zip(seen, chosen, strict=True)
    ]
    assert {item.kind for item in measure(recording(commands, late), SETTINGS).findings} == {
        "clock"
    }


def test_order_and_names_of_the_episodes_change_nothing():
    commands, _, _ = world()
    seen = shifted(answers(commands), part_of(0.3), BESIDE)
    noise = stream(3, "noise")
    seen = [part + 5e-4 * noise.normal(size=part.shape) for part in seen]
    (item,) = found(build(commands, seen, epochs=1, period_s=PERIOD_S))
    order = stream(5, "order").permutation(EPISODES)
    (other,) = found(
        build([commands[k] for k in order], [seen[k] for k in order], epochs=1, period_s=PERIOD_S)
    )
    assert (other.variable, other.measured) == (item.variable, pytest.approx(item.measured))


def test_without_a_pair_nothing_is_asked():
    commands, _, _ = world()
    seen = shifted(answers(commands), part_of(0.3), BESIDE)
    assert found(replace(recording(commands, seen), paired=False)) == []
