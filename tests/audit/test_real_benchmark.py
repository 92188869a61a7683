"""What the recordings of `benchmarks.audit_real` claim is so, seen without an audit."""

import numpy as np
import pytest

from benchmarks.audit_real.bases.real import here
from benchmarks.audit_real.catalogue import (
    AS_IS,
    BASES,
    CHANGES,
    Case,
    base_of,
    fits,
    made,
)
from benchmarks.audit_real.plan import Plan
from benchmarks.audit_real.writers import write
from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset

OWN = [name for name in BASES if name not in ("pusht", "g1")]
WITH_WAYS = [name for name in OWN if base_of(name).truth.modes > 1 and name not in ("goals",)]
SEED = 11


def small(base, *names, seed=SEED, episodes=24):
    """A small recording with these changes at their first strengths."""
    changes = tuple((name, CHANGES[name].strengths[0]) for name in names)
    return made(Case(base, changes, seed), episodes=episodes)


def resampled(episode, rows=40):
    """The commanded way of an episode at equal shares of its length. Shape (rows, P)."""
    steps = np.linalg.norm(np.diff(episode.command, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)]) + 1e-9 * np.arange(len(episode))
    at = np.linspace(0.0, along[-1], rows)
    return np.stack([np.interp(at, along, column) for column in episode.command.T], axis=1)


def paired(recording, episode):
    """What is observed of each commanded number. Shape (T, P)."""
    places = [place for place in recording.follows if place is not None]
    return np.stack([episode.seen[name][:, k] for name, k in places], axis=1)


@pytest.mark.parametrize("base", OWN)
def test_the_same_seed_gives_the_same_rows_and_another_does_not(base):
    first, again, other = (BASES[base](Plan(seed, episodes=6)) for seed in (3, 3, 4))
    assert [e.action.tobytes() for e in first.episodes] == [
        e.action.tobytes() for e in again.episodes
    ]
    assert first.episodes[0].action.tobytes() != other.episodes[0].action.tobytes()


@pytest.mark.parametrize("base", WITH_WAYS)
def test_ways_lie_apart_by_more_than_they_scatter(base):
    recording = BASES[base](Plan(SEED, episodes=48))
    # As far as the first choice: a person in the kitchen comes back and chooses again.
    ways = np.array([int(e.mode[0]) for e in recording.episodes])
    cut = [e.taken(np.flatnonzero(e.mode == e.mode[0])) for e in recording.episodes]
    routes = np.stack([resampled(e)[:, : len(recording.paired)] for e in cut])
    means = {way: routes[ways == way].mean(axis=0) for way in np.unique(ways)}
    scatter = max(
        np.sqrt(((routes[ways == way] - mean) ** 2).sum(axis=2).mean())
        for way, mean in means.items()
    )
    apart = min(
        np.sqrt(((means[a] - means[b]) ** 2).sum(axis=1).max())
        for a in means for b in means if a < b
    )  # fmt: skip
    assert apart > 2.0 * scatter
    assert len(np.unique(ways)) >= min(recording.truth.modes, 3)


@pytest.mark.parametrize("base", [b for b in OWN if base_of(b).truth.modes == 1])
def test_one_way_is_one_way(base):
    recording = BASES[base](Plan(SEED, episodes=40))
    routes = np.stack([resampled(e) for e in recording.episodes])[:, :, recording.paired]
    spread = np.sqrt(((routes - routes.mean(axis=0)) ** 2).sum(axis=2).mean())
    assert spread < 0.5 * np.sqrt(
        ((routes.mean(axis=0) - routes.mean(axis=(0, 1))) ** 2).sum(1).mean()
    )


def told_by_start(recording):
    """Share of held-out episodes whose first way the first observed row tells, a linear guess."""
    begin = np.stack([np.concatenate([v[0] for v in e.seen.values()]) for e in recording.episodes])
    begin = (begin - begin.mean(axis=0)) / np.maximum(begin.std(axis=0), 1e-9)
    begin = np.column_stack([begin, np.ones(len(begin))])
    ways = np.array([int(e.mode[0]) for e in recording.episodes])
    kinds = np.eye(ways.max() + 1)[ways]
    half = np.arange(len(ways)) % 2 == 0
    guess = begin[~half] @ np.linalg.lstsq(begin[half], kinds[half], rcond=1e-6)[0]
    return np.mean(guess.argmax(axis=1) == ways[~half])


@pytest.mark.parametrize("base", WITH_WAYS)
def test_a_way_by_chance_shows_in_no_start(base):
    recording = BASES[base](Plan(SEED, episodes=240))
    kinds = len({int(e.mode[0]) for e in recording.episodes})
    assert told_by_start(recording) < 1.0 / kinds + 0.17


@pytest.mark.parametrize("base", ["pushing", "arm_two", "planner"])
def test_a_way_by_the_start_shows_in_it(base):
    assert told_by_start(BASES[base](Plan(SEED, decided_by="start", episodes=240))) > 0.9


def test_the_goal_of_a_row_is_where_the_point_then_goes():
    recording = small("goals")
    for episode in recording.episodes:
        for goal in np.unique(episode.rows["goal"]):
            rows = np.flatnonzero(episode.rows["goal"] == goal)
            last = rows[np.append(np.flatnonzero(np.diff(rows) > 1), len(rows) - 1)]
            corner = np.array([[0.2, 0.2], [0.8, 0.2], [0.8, 0.8], [0.2, 0.8]])[goal]
            assert np.linalg.norm(episode.command[last] - corner, axis=1).max() < 0.1


@pytest.mark.parametrize(
    ("base", "form"),  # a base that has that form already does not take it
    [(base, form) for form in ("delta", "velocity") for base in OWN if fits(base, [form])],
)
def test_differences_add_up_to_the_command(base, form):
    recording = small(base, form, episodes=4)
    factor = 1.0 / recording.rate_hz if form == "velocity" else 1.0
    for episode in recording.episodes:
        moved = factor * np.cumsum(episode.action[:, recording.paired], axis=0)
        wanted = episode.command[:, recording.paired]
        assert moved == pytest.approx(wanted - wanted[:1], abs=1e-9)


@pytest.mark.parametrize("base", OWN)
def test_what_is_observed_follows_what_is_commanded(base):
    recording = BASES[base](Plan(SEED, episodes=6))
    for episode in recording.episodes:
        seen, told = paired(recording, episode), episode.command[:, recording.paired]
        moving = np.ptp(told, axis=0) > 0.2 * np.ptp(told, axis=0).max()
        errors = [
            np.sqrt(np.mean((seen[lag:] - told[: len(told) - lag])[:, moving] ** 2))
            for lag in range(12)
        ]
        assert min(errors) < 0.1 * np.ptp(told[:, moving], axis=0).max()


@pytest.mark.parametrize("base", [b for b in OWN if fits(b, ["what decides is observed"])])
def test_an_observed_cue_tells_what_is_done_within_the_next_actions_as_well(base):
    """Who chooses again in an episode chooses within a chunk: the cue of now says nothing of it."""
    recording = small(base, "what decides is observed", episodes=48)
    (cue,) = (name for name in recording.episodes[0].seen if name.endswith("cue"))
    told = {}
    for episode in recording.episodes:
        for row, shown in enumerate(episode.seen[cue].tolist()):
            later = episode.mode[row:]
            then = later[later != later[0]][:1].tolist()
            told.setdefault(tuple(shown), set()).add((int(later[0]), *then))
    assert all(len(done) == 1 for done in told.values())


def test_an_hour_tells_the_way_and_is_never_the_same_twice():
    recording = small("avoiding", "hour decides, in every row", episodes=40)
    hours = np.array([e.rows["hour"][0] for e in recording.episodes])
    assert len(np.unique(hours)) == 40
    by_time = recording.modes[np.argsort(hours)]
    assert np.count_nonzero(np.diff(by_time)) == 3


def test_rows_that_are_lost_leave_their_stamps():
    clean, lossy = small("pushing"), small("pushing", "rows lost in a third")
    for before, after in zip(clean.episodes, lossy.episodes, strict=True):
        rows = np.searchsorted(before.time_s, after.time_s)
        assert np.array_equal(before.action[rows], after.action)
        gaps = np.diff(after.time_s) * clean.rate_hz
        assert gaps.max() == pytest.approx(2.0 if after.faulty else 1.0)


@pytest.mark.parametrize("base", ["pushing", "avoiding", "arm"])
def test_a_turned_frame_keeps_lengths_and_the_angle_is_the_one_said(base):
    clean, turned = small(base), small(base, "a frame turned in 30 %")
    for before, after in zip(clean.episodes, turned.episodes, strict=True):
        a, b = np.diff(before.action[:, :2], axis=0), np.diff(after.action[:, :2], axis=0)
        dot, cross = (a * b).sum(), (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
        wanted = 30.0 if after.faulty else 0.0
        assert np.rad2deg(np.arctan2(cross, dot)) == pytest.approx(wanted, abs=1e-6)
        assert np.linalg.norm(b, axis=1) == pytest.approx(np.linalg.norm(a, axis=1))


FAULTS = {
    "a third in another unit": 1 / 3, "a third in another unit, all of it": 1 / 3,
    "lag in half": 0.5, "a sign flipped": 0.3, "two columns swapped": 0.25, "glued to a copy": 0.3,
    "a frozen sensor": 1 / 3,
}  # fmt: skip


@pytest.mark.parametrize("base", ["pushing", "arm", "planner", "goals"])
@pytest.mark.parametrize("name", list(FAULTS))
def test_a_fault_is_in_the_episodes_said_and_in_no_other(base, name):
    clean, faulty = small(base), small(base, name)
    assert faulty.truth.defect and not clean.truth.defect
    wrong = [e.faulty for e in faulty.episodes]
    assert np.mean(wrong) == pytest.approx(FAULTS[name], abs=0.05)
    for before, after in zip(clean.episodes, faulty.episodes, strict=True):
        same = len(before) == len(after) and np.array_equal(before.action, after.action)
        same = same and all(np.array_equal(v, after.seen[n]) for n, v in before.seen.items())
        assert same is not after.faulty


@pytest.mark.parametrize("base", ["pushing", "planner", "aloha"])
def test_an_offset_is_one_shift_of_what_the_commands_move_in_a_part(base):
    name = "a calibration offset in 30 %"
    clean, faulty = small(base), small(base, name)
    shifts = []
    for before, after in zip(clean.episodes, faulty.episodes, strict=True):
        assert np.array_equal(before.action, after.action)
        moved = paired(faulty, after) - paired(clean, before)
        assert np.ptp(moved, axis=0).max() < 1e-9
        assert bool(np.any(moved[0])) is after.faulty
        shifts += [moved[0]] * after.faulty
    assert len(shifts) == round(0.3 * len(clean.episodes)) and np.ptp(shifts, axis=0).max() < 1e-9
    far = CHANGES[name].strengths[0] * clean.scale
    assert np.linalg.norm(shifts[0]) == pytest.approx(far)
    assert faulty.truth.defect == "calibration" and not fits("goals", [name])


def test_each_fault_is_what_it_is_called():
    clean = small("planner")
    pairs = {
        name: [
            (a, b)
            for a, b in zip(clean.episodes, small("planner", name).episodes, strict=True)
            if b.faulty
        ]
        for name in FAULTS
    }
    for a, b in pairs["a third in another unit"]:
        assert b.action == pytest.approx(0.01 * a.action)
    for a, b in pairs["lag in half"]:
        late = len(a) - len(b)
        assert late == 3 and np.array_equal(a.action[late:], b.action)
        assert np.array_equal(a.seen["observation.state"][:-late], b.seen["observation.state"])
    for a, b in pairs["a sign flipped"]:
        turned = np.flatnonzero((a.action != b.action).any(axis=0))
        assert len(turned) == 1 and np.array_equal(a.action[:, turned], -b.action[:, turned])
    for a, b in pairs["two columns swapped"]:
        one, two = np.flatnonzero((a.action != b.action).any(axis=0))
        assert np.array_equal(a.action[:, [one, two]], b.action[:, [two, one]])
    for _, b in pairs["glued to a copy"]:
        half = len(b) // 2
        assert np.array_equal(b.action[:half], b.action[half:])
    for _, b in pairs["a frozen sensor"]:
        still = np.flatnonzero((np.diff(b.seen["observation.state"], axis=0) == 0).all(axis=1))
        assert len(still) >= 15 and np.ptp(b.action[still], axis=0).max() > 0.05


@pytest.mark.parametrize("name", ["task decides", "zq7 decides", "latent decides, in every row"])
@pytest.mark.parametrize("fidelity", [1.0, 0.95])
def test_a_column_that_decides_says_the_way_as_often_as_it_is_said_to(name, fidelity):
    recording = made(Case("pushing", ((name, fidelity),), SEED), episodes=120)
    column = recording.truth.decided_by
    said = [str(e.facts.get(column, e.rows.get(column, [0])[0])) for e in recording.episodes]
    values = sorted(set(said))
    told = np.mean([values.index(s) == way for s, way in zip(said, recording.modes, strict=True)])
    assert max(told, 1.0 - told) == pytest.approx(fidelity, abs=0.01)
    assert [a.cause for a in recording.truth.answers()] == ["hidden_state"]


def test_turns_are_seen_in_the_order_and_chance_is_not():
    for name, low, high in ((AS_IS, 0.3, 0.7), ("turns", 0.75, 1.0)):
        ways = small("pushing", name, episodes=120).modes
        assert low < np.mean(ways[1:] == ways[:-1]) <= high


def test_turns_that_are_shuffled_leave_no_trace_and_a_sensor_freezes_while_the_arm_moves():
    shuffled = small("pushing", "turns", "episodes shuffled", episodes=120)
    assert np.mean(shuffled.modes[1:] == shuffled.modes[:-1]) < 0.7
    assert [a.cause for a in shuffled.truth.answers()] == ["valid_modes"]
    assert [a.cause for a in small("pushing", "turns").truth.answers()] == ["hidden_state"]
    for episode in small("pushing", "waits at first", "a frozen sensor").episodes:
        seen = episode.seen["observation.state"]
        still = (np.diff(seen, axis=0) == 0).all(axis=1)
        moves = (np.diff(episode.command, axis=0) != 0).any(axis=1)
        assert np.count_nonzero(still & moves) >= 7 or not episode.faulty


@pytest.mark.parametrize("base", ["pushing", "arm", "avoiding", "humanoid"])
def test_waits_are_equal_rows_in_which_nothing_is_commanded(base):
    clean, waiting = small(base), small(base, "waits at first")
    for before, after in zip(clean.episodes, waiting.episodes, strict=True):
        rows = len(after) - len(before)
        assert rows >= 3
        for values in after.seen.values():
            assert (values[: rows + 1] == values[0]).all()
        moved = after.action[:rows, waiting.paired]
        wanted = paired(waiting, after)[:rows] if waiting.form == "absolute" else 0.0
        assert moved == pytest.approx(wanted * np.ones_like(moved))


def test_quaternions_change_their_sign_and_nothing_else_changes():
    clean, flipped = small("arm"), small("arm", "signs of quaternions")
    changed = False
    for before, after in zip(clean.episodes, flipped.episodes, strict=True):
        for name, values in before.seen.items():
            assert np.abs(after.seen[name]) == pytest.approx(np.abs(values))
            if name.endswith("quat"):
                assert np.linalg.norm(after.seen[name], axis=1) == pytest.approx(1.0)
                changed |= not np.array_equal(values, after.seen[name])
            if name.endswith("eef_pos"):
                assert np.array_equal(values, after.seen[name])
    assert changed


def test_order_and_names_change_no_number_of_any_episode():
    clean = {e.number: e for e in small("planner").episodes}
    for name in ("episodes shuffled", "episodes in reverse", "names absent", "names are nonsense"):
        for episode in small("planner", name).episodes:
            assert np.array_equal(episode.action, clean[episode.number].action)
    order = [e.number for e in small("planner", "episodes shuffled").episodes]
    assert order != sorted(order) and sorted(order) == sorted(clean)


@pytest.mark.parametrize("ahead", ["one", "the other"])
def test_merged_by_side_holds_one_side_after_the_other(ahead):
    merged = small("pushing", f"each collection has its side, {ahead} first")
    ways = merged.modes
    assert np.count_nonzero(np.diff(ways)) == 1 and ways[0] == (0 if ahead == "one" else 1)
    sources = [e.facts["collection"] for e in merged.episodes]
    assert len(set(sources)) == 2 and all((s == sources[0]) == (w == ways[0])
                                          for s, w in zip(sources, ways, strict=True))  # fmt: skip


@pytest.mark.parametrize(
    "layout", ["as LeRobot v2.1", "as LeRobot v3", "as robomimic", "as Parquet files",
               "as one Parquet table", AS_IS],
)  # fmt: skip
def test_the_import_reads_back_what_was_written(layout, tmp_path):
    base = "arm_two" if layout == "as LeRobot v2.1" else "pushing"
    recording = small(base, *([] if fits(base, [layout]) is False else [layout]))
    opened = open_dataset(write(recording, tmp_path / "r"), out=tmp_path / "dataset")
    assert opened.accepted == len(recording.episodes)
    frames = load_dataset(tmp_path / "dataset").frames
    # Accepted episodes come in an order of their own.
    read = [frames.action[frames.episode == k] for k in np.unique(frames.episode)]
    for episode in recording.episodes:
        same = [
            k
            for k, rows in enumerate(read)
            if rows.shape == episode.action.shape
            and np.allclose(rows, episode.action, rtol=1e-5, atol=1e-4)
        ]
        assert len(same) == 1
        read.pop(same[0])
    assert not read
    assert frames.observation.shape[1] == sum(
        v.shape[1] for v in recording.episodes[0].seen.values()
    )


@pytest.mark.skipif(not here(), reason="the two real sets are not here")
def test_the_real_sets_are_read_as_they_are():
    pusht, g1 = base_of("pusht"), base_of("g1")
    whole = BASES["pusht"](Plan(1))
    assert len(whole.episodes) == 206 and sum(map(len, whole.episodes)) == 25_650
    assert 0.3 < np.mean([e.mode[0] for e in whole.episodes]) < 0.7
    assert g1.episodes[0].action.shape[1] == 26 and len(pusht.episodes) == 24
