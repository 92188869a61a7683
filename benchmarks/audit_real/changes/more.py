"""Further changes: an hour that decides, lost rows, a frame that was turned or shifted."""

from dataclasses import replace

import numpy as np

from benchmarks.audit_real.changes.change import (
    COLUMNS,
    DEFECT,
    Change,
    Place,
    at_places,
    free,
    published,
    some,
    steady,
)
from benchmarks.audit_real.changes.defects import DEFECT_SAID
from benchmarks.audit_real.recording import Episode, Recording

DAY_H = (8.0, 18.0)


def _hour(recording: Recording, place: Place, strength: float) -> Recording:
    """Another way at another time of day; the hour stands in every row, never the same twice."""
    span = (DAY_H[1] - DAY_H[0]) / recording.truth.modes
    hours = DAY_H[0] + span * (
        recording.modes + place.rng.uniform(0.02, 0.98, len(recording.modes))
    )
    episodes = tuple(
        replace(e, rows={**e.rows, "hour": np.full(len(e), hour)})
        for e, hour in zip(recording.episodes, hours, strict=True)
    )
    return replace(recording, episodes=episodes).true(
        decided_by="hour", names=("hour",),
        undecided=recording.truth.undecided if recording.real else "",
    )  # fmt: skip


def _lost(recording: Recording, place: Place, share: float) -> Recording:
    """Rows lost on the way in a third of the episodes; the stamps of the others are their own."""

    def change(episode: Episode) -> Episode:
        count = len(episode)
        # Single rows, apart from each other and from both ends.
        slots = np.arange(3, count - 3, 3)
        gone = slots[place.rng.permutation(len(slots))[: max(1, round(share * count))]]
        rows = np.setdiff1d(np.arange(count), gone)
        assert episode.time_s is not None
        return replace(episode.taken(rows), time_s=episode.time_s[rows])

    return at_places(recording, some(recording, place, 1.0 / 3.0), change).true(defect="gap")


def _turned(recording: Recording, place: Place, degrees: float) -> Recording:
    """The first two commands in a frame that is turned, about the middle of what is commanded."""
    pair = recording.paired[:2]
    middle = np.zeros(2)
    if recording.form == "absolute":
        middle = np.concatenate([e.action[:, pair] for e in recording.episodes]).mean(axis=0)
    angle = np.deg2rad(degrees)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def change(episode: Episode) -> Episode:
        action = episode.action.copy()
        action[:, pair] = (action[:, pair] - middle) @ turn.T + middle
        return replace(episode, action=action)

    return at_places(recording, some(recording, place, 0.3), change).true(defect="frame")


def _shifted(recording: Recording, place: Place, strength: float) -> Recording:
    """What is observed of the commanded numbers stands beside, all along and one way."""
    pairs = [at for at in recording.follows if at is not None]
    way = place.rng.normal(size=len(pairs))
    shift = strength * recording.scale * way / np.linalg.norm(way)

    def change(episode: Episode) -> Episode:
        seen = {name: values.copy() for name, values in episode.seen.items()}
        for (name, number), size in zip(pairs, shift, strict=True):
            seen[name][:, number] += size
        return replace(episode, seen=seen)

    return at_places(recording, some(recording, place, 0.3), change).true(defect="calibration")


def _another_scale(recording: Recording, place: Place, factor: float) -> Recording:
    """A third is told more or less of the same way, from its begin."""

    def change(episode: Episode) -> Episode:
        action, told = episode.action.copy(), recording.paired
        begin = action[:1, told]
        action[:, told] = begin + factor * (action[:, told] - begin)
        return replace(episode, action=action)

    return at_places(recording, some(recording, place, 1.0 / 3.0), change).true(defect="unit")


MORE = (
    Change(
        "hour decides, in every row", COLUMNS, _hour, "hidden_state(hour)",
        fits=lambda r: free(r) and steady(r) and r.layout != "robomimic",
    ),
    Change(
        "rows lost in a third", DEFECT, _lost, DEFECT_SAID.format("gap"), (0.1, 0.2),
        "share of their rows", fits=lambda r: r.episodes[0].time_s is not None,
    ),
    Change(
        "a frame turned in 30 %", DEFECT, _turned, DEFECT_SAID.format("frame"), (30.0, 90.0),
        "degrees", fits=lambda r: len(r.paired) in (2, 3),
    ),
)  # fmt: skip
# After all others, whose strengths and draws go by their place.
LATER = (
    Change(
        "a calibration offset in 30 %", DEFECT, _shifted, DEFECT_SAID.format("calibration"),
        (0.5, 0.25, 0.1), "of the ways apart",
        fits=lambda r: r.form == "absolute" and bool(r.paired),
    ),
    Change(
        "a third of another scale", DEFECT, _another_scale, DEFECT_SAID.format("unit"),
        (1.5, 2.54, 0.5), "factor of the commanded motion",
        fits=lambda r: r.form == "absolute" and len(r.paired) > 1 and not published(r),
    ),
)  # fmt: skip
