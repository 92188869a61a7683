"""What goes wrong in a part of the episodes: units, clocks, signs, places of columns, copies."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.audit_real.changes.change import DEFECT, Change, Place, at_places, published, some
from benchmarks.audit_real.recording import Episode, Recording

DEFECT_SAID = "data_defect({})"


def _unit(both: bool) -> Callable[[Recording, Place, float], Recording]:
    def apply(recording: Recording, place: Place, factor: float) -> Recording:
        if published(recording) and factor > 1.0:
            return recording  # its contract states the range of a pixel: such episodes are refused
        columns = {at[0]: [] for at in recording.follows if at is not None}
        for at in recording.follows:
            if at is not None:
                columns[at[0]].append(at[1])

        def change(episode: Episode) -> Episode:
            seen = {name: values.copy() for name, values in episode.seen.items()}
            if both:
                for name, places in columns.items():
                    seen[name][:, places] *= factor
            action = episode.action.copy()
            action[:, recording.paired] *= factor
            return replace(episode, action=action, seen=seen)

        third = some(recording, place, 1.0 / 3.0)
        return at_places(recording, third, change).true(defect="unit")

    return apply


def _lag(recording: Recording, place: Place, rows: float) -> Recording:
    """All that is observed reaches half of the episodes some rows late."""
    late = int(rows)

    def change(episode: Episode) -> Episode:
        count = len(episode) - late
        cut = episode.taken(np.arange(late, len(episode)))
        return replace(cut, seen={n: v[:count] for n, v in episode.seen.items()})

    return at_places(recording, some(recording, place, 0.5), change).true(defect="clock")


def _moving(recording: Recording, place: Place) -> list[int]:
    """Actions that command something and move, the most moved ones, in random order."""
    steps = np.concatenate([np.diff(e.command, axis=0) for e in recording.episodes])
    motion = np.abs(steps).mean(axis=0)
    paired = recording.paired
    good = [k for k in paired if motion[k] > 0.3 * motion[paired].max()]
    return [good[k] for k in place.rng.permutation(len(good))]


def _sign(recording: Recording, place: Place, share: float) -> Recording:
    joint = _moving(recording, place)[0]
    pixels = recording.form == "absolute" and recording.scale > 50.0

    def change(episode: Episode) -> Episode:
        action = episode.action.copy()
        action[:, joint] = (512.0 if pixels else 0.0) - action[:, joint]
        return replace(episode, action=action)

    return at_places(recording, some(recording, place, share), change).true(defect="frame")


def _swap(recording: Recording, place: Place, share: float) -> Recording:
    first, second = _moving(recording, place)[:2]

    def change(episode: Episode) -> Episode:
        action = episode.action.copy()
        action[:, [first, second]] = action[:, [second, first]]
        return replace(episode, action=action)

    return at_places(recording, some(recording, place, share), change).true(defect="swap")


def _in_motion(episode: Episode) -> NDArray[np.int64]:
    """Rows in which the commands move."""
    steps = np.linalg.norm(np.diff(episode.command, axis=0), axis=1)
    return np.flatnonzero(steps > 0.2 * np.median(steps[steps > 0.0]))


def _glue(recording: Recording, place: Place, share: float) -> Recording:
    """Played twice in one episode, the rows at rest left out between."""

    def change(episode: Episode) -> Episode:
        moving = _in_motion(episode)
        inner = np.arange(moving[0], moving[-1] + 1)
        return episode.taken(np.concatenate([inner, inner]))

    return at_places(recording, some(recording, place, share), change).true(defect="glued")


def _again(recording: Recording, place: Place, share: float) -> Recording:
    """Stored once more with fewer digits, as another tool exports it; the copies come last."""
    places = some(recording, place, share)

    def rounded(episode: Episode) -> Episode:
        digits = 4 - int(np.floor(np.log10(recording.scale)))
        return replace(
            episode, faulty=True, action=np.round(episode.action, digits),
            seen={n: np.round(v, digits) for n, v in episode.seen.items()},
        )  # fmt: skip

    copies = tuple(rounded(recording.episodes[k]) for k in sorted(places))
    return replace(recording, episodes=(*recording.episodes, *copies)).true(defect="duplicate")


def _frozen(recording: Recording, place: Place, seconds: float) -> Recording:
    """A sensor repeats one sample in the middle of the motion, in a third of the episodes."""
    held = max(2, round(seconds * recording.rate_hz))

    def change(episode: Episode) -> Episode:
        moves = _in_motion(episode)
        begin = int(moves[int(place.rng.integers(len(moves) // 4, len(moves) // 2 + 1))])
        rows = np.arange(len(episode))
        rows[begin : begin + held] = begin
        return replace(episode, seen={n: v[rows] for n, v in episode.seen.items()})

    third = some(recording, place, 1.0 / 3.0)
    return at_places(recording, third, change).true(defect="frozen")


def _unit_fits(recording: Recording) -> bool:
    return bool(recording.paired)


def _angles(recording: Recording) -> bool:
    return 0.3 < recording.scale < 50.0 and recording.form == "absolute"


DEFECTS = (
    Change(
        "a third in another unit", DEFECT, _unit(False), DEFECT_SAID.format("unit"),
        (0.01, 1.0 / 512.0, 0.1, 1000.0), "factor of the actions", fits=_unit_fits,
    ),
    Change(
        "a third in degrees", DEFECT, _unit(False), DEFECT_SAID.format("unit"),
        (180.0 / np.pi,), "factor of the actions", fits=_angles,
    ),
    Change(
        "a third in another unit, all of it", DEFECT, _unit(True), DEFECT_SAID.format("unit"),
        (0.01, 1.0 / 512.0, 1000.0), "factor of actions and of what they command",
        fits=_unit_fits,
    ),
    Change(
        "lag in half", DEFECT, _lag, DEFECT_SAID.format("clock"), (3, 4, 6), "rows",
        fits=_unit_fits,
    ),
    Change(
        "a sign flipped", DEFECT, _sign, DEFECT_SAID.format("frame"), (0.3, 0.15),
        "share of the episodes", fits=_unit_fits,
    ),
    Change(
        "two columns swapped", DEFECT, _swap, DEFECT_SAID.format("swap"), (0.25, 0.1),
        "share of the episodes", fits=lambda r: len(r.paired) > 1,
    ),
    Change(
        "glued to a copy", DEFECT, _glue, DEFECT_SAID.format("glued"), (0.3, 0.1),
        "share of the episodes",
    ),
    Change(
        "stored again with fewer digits", DEFECT, _again, DEFECT_SAID.format("duplicate"),
        (0.2, 0.08), "share of the episodes",
    ),
    Change(
        "a frozen sensor", DEFECT, _frozen, DEFECT_SAID.format("frozen"), (1.0,), "s",
    ),
)  # fmt: skip
