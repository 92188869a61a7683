"""Clocks, order and places in time: waits, shuffles, merges, copies, tremor; mostly harmless."""

from dataclasses import replace

import numpy as np

from benchmarks.audit_real.changes.change import (
    DEFECT,
    MERGE,
    NAMES,
    TIME,
    Change,
    Place,
    published,
    some,
    unchanged,
)
from benchmarks.audit_real.changes.forms import SAME
from benchmarks.audit_real.recording import Array, Episode, Recording
from benchmarks.audit_real.truth import UNRECORDED


def _still(recording: Recording, episode: Episode) -> Array:
    """The action of an arm that stays where it begins. Shape (A,)."""
    action = episode.action[0].copy()
    for k, place in enumerate(recording.follows):
        if place is not None:
            first = float(episode.seen[place[0]][0, place[1]])
            action[k] = first if recording.form == "absolute" else 0.0
        elif recording.form != "absolute" and abs(abs(action[k]) - 1.0) > 1e-9:
            action[k] = 0.0
    return action


def _waits(recording: Recording, place: Place, seconds: float) -> Recording:
    def change(episode: Episode) -> Episode:
        rows = max(3, round(seconds * recording.rate_hz * place.rng.uniform(0.6, 1.4)))
        longer = episode.taken(np.concatenate([np.zeros(rows, dtype=int), np.arange(len(episode))]))
        action = longer.action.copy()
        action[:rows] = _still(recording, episode)
        command = longer.command.copy()
        return replace(longer, action=action, command=command)

    return recording.each(change)


def _jitter(recording: Recording, place: Place, share: float) -> Recording:
    def change(episode: Episode) -> Episode:
        late = share / recording.rate_hz * place.rng.uniform(-1.0, 1.0, len(episode))
        late[0] = 0.0
        assert episode.time_s is not None
        return replace(episode, time_s=episode.time_s + late)

    return recording.each(change)


def _no_clock(recording: Recording, place: Place, strength: float) -> Recording:
    return recording.each(lambda e: replace(e, time_s=None))


def _shuffled(recording: Recording, place: Place, strength: float) -> Recording:
    order = place.rng.permutation(len(recording.episodes))
    shuffled = replace(recording, episodes=tuple(recording.episodes[k] for k in order))
    # What only the order told is a free choice now.
    return shuffled.true(decided_by="") if recording.truth.decided_by == "order" else shuffled


def _reversed(recording: Recording, place: Place, strength: float) -> Recording:
    return replace(recording, episodes=recording.episodes[::-1])


def _merged(first: bool) -> Change:
    def apply(recording: Recording, place: Place, strength: float) -> Recording:
        if recording.real:
            halves = (recording.episodes[::2], recording.episodes[1::2])
            return replace(recording, episodes=sum(halves if first else halves[::-1], ()))
        count = round(0.6 * len(recording.episodes))
        own = place.make(replace(place.plan, episodes=count))
        other = place.make(replace(place.plan, seed=place.plan.seed + 500_000, episodes=count))
        parts = (own, other) if first else (other, own)
        return replace(recording, episodes=(*parts[0].episodes, *parts[1].episodes))

    return Change(
        f"two collections merged, {'one' if first else 'the other'} first", MERGE, apply, SAME
    )


def _by_side(ahead: bool, recorded: bool) -> Change:
    def apply(recording: Recording, place: Place, strength: float) -> Recording:
        sides = recording.modes % 2
        episodes = tuple(
            replace(e, facts={**e.facts, "collection": f"run_{'ab'[int(side)]}"}) if recorded else e
            for e, side in zip(recording.episodes, sides, strict=True)
        )
        order = np.argsort(sides if ahead else 1 - sides, kind="stable")
        return replace(recording, episodes=tuple(episodes[k] for k in order)).true(
            decided_by="collection" if recorded else "order", undecided="",
            names=("collection", *UNRECORDED),
        )  # fmt: skip

    which = "one" if ahead else "the other"
    return Change(
        f"each collection has its side, {which} first{'' if recorded else ', not recorded'}", TIME,
        apply, "hidden_state(collection), or the order that stands for it",
        fits=lambda r: r.truth.modes == 2 and not r.truth.decided_by and r.layout != "zarr",
    )  # fmt: skip


def _copies(recording: Recording, place: Place, share: float) -> Recording:
    """Stored twice to the bit: the import refuses the second, and nothing else changes."""
    places = sorted(some(recording, place, share))
    copies = tuple(recording.episodes[k] for k in places)
    return replace(recording, episodes=(*recording.episodes, *copies))


def _signs(recording: Recording, place: Place, strength: float) -> Recording:
    """q and -q are one rotation: recorders change the sign at will."""

    def change(episode: Episode) -> Episode:
        seen = {}
        for name, values in episode.seen.items():
            flipped = values.copy()
            for first in _quaternions(recording, name):
                sign = place.rng.choice([-1.0, 1.0])
                at = int(place.rng.integers(1, len(episode)))
                signs = np.where(np.arange(len(episode)) < at, sign, -sign)
                flipped[:, first : first + 4] *= signs[:, None]
            seen[name] = flipped
        return replace(episode, seen=seen)

    return recording.each(change)


def _quaternions(recording: Recording, name: str) -> list[int]:
    """Where four neighbouring numbers have unit norm in every row."""
    values = np.concatenate([e.seen[name] for e in recording.episodes])
    found, k = [], 0
    while k + 4 <= values.shape[1]:
        part = values[:, k : k + 4]
        # A one-hot number has the norm too; it is never negative.
        if part.min() < 0.0 and np.allclose(np.linalg.norm(part, axis=1), 1.0, atol=1e-6):
            found.append(k)
            k += 4
        else:
            k += 1
    return found


def _has_quaternions(recording: Recording) -> bool:
    return any(_quaternions(recording, name) for name in recording.names)


def _millimetres(recording: Recording, place: Place, factor: float) -> Recording:
    """Everything that is commanded in another unit, in all episodes alike."""
    places = [at for at in recording.follows if at is not None]

    def change(episode: Episode) -> Episode:
        seen = {name: values.copy() for name, values in episode.seen.items()}
        for name, k in places:
            seen[name][:, k] *= factor
        action = episode.action.copy()
        action[:, recording.paired] *= factor
        return replace(episode, seen=seen, action=action)

    return recording.each(change)


def _rounded(recording: Recording, place: Place, share: float) -> Recording:
    step = share * recording.scale

    def change(episode: Episode) -> Episode:
        seen = {n: np.round(v / step) * step for n, v in episode.seen.items()}
        return replace(episode, seen=seen)

    return recording.each(change)


def _rests_at_end(recording: Recording, place: Place, seconds: float) -> Recording:
    def change(episode: Episode) -> Episode:
        rows = max(3, round(seconds * recording.rate_hz * place.rng.uniform(0.6, 1.4)))
        last = len(episode) - 1
        longer = episode.taken(np.concatenate([np.arange(last + 1), np.full(rows, last)]))
        action = longer.action.copy()
        if recording.form != "absolute":
            action[-rows:] = _still(recording, episode.taken(np.array([last, last])))
        seen = {
            n: v + np.where(np.arange(len(v)) > last, 1.0, 0.0)[:, None]
            * 1e-4 * recording.scale * place.rng.normal(size=v.shape)
            for n, v in longer.seen.items()
        }  # fmt: skip
        return replace(longer, action=action, seen=seen)

    return recording.each(change)


def _tremor(recording: Recording, place: Place, strength: float) -> Recording:
    """One commanded number trembles: white noise, of the size of the motion of a chunk."""
    k = recording.paired[int(place.rng.integers(len(recording.paired)))]
    spread = float(np.std(np.concatenate([e.action[:, k] for e in recording.episodes])))

    def change(episode: Episode) -> Episode:
        action = episode.action.copy()
        action[:, k] += strength * spread * place.rng.normal(size=len(episode))
        return replace(episode, action=action)

    return recording.each(change)


def _loud(recording: Recording, place: Place, strength: float) -> Recording:
    return _tremor(recording, place, strength).true(
        tremor=True, undecided=recording.truth.undecided or "one number of many trembles"
    )


def _one_way(recording: Recording) -> bool:
    return recording.truth.modes < 2 and bool(recording.paired)


TIMES = (
    Change("waits at first", TIME, _waits, SAME, (0.5, 1.5), "s"),
    Change("rests at the end", TIME, _rests_at_end, SAME, (0.5, 1.5), "s"),
    Change(
        "clock jitters", TIME, _jitter, SAME, (0.05, 0.15), "of a period",
        fits=lambda r: r.episodes[0].time_s is not None,
    ),
    Change("no clock", TIME, _no_clock, SAME, fits=lambda r: r.episodes[0].time_s is not None),
    Change("episodes shuffled", TIME, _shuffled, SAME),
    Change("episodes in reverse", TIME, _reversed, SAME),
    _merged(True),
    _merged(False),
    _by_side(True, True),
    _by_side(False, True),
    _by_side(True, False),
    Change("stored twice to the bit", DEFECT, _copies, SAME, (0.1, 0.3), "share of the episodes"),
    Change("signs of quaternions", TIME, _signs, SAME, fits=_has_quaternions),
    Change(
        "all in another unit", TIME, _millimetres, SAME, (1000.0,), "factor",
        fits=lambda r: bool(r.paired) and r.form == "absolute" and not published(r),
    ),
    Change("rounded", TIME, _rounded, SAME, (1e-4, 1e-3), "of the ways apart"),
    Change("a small tremor", TIME, _tremor, SAME, (0.02,), "of its spread", fits=_one_way),
    Change(
        "a tremor", TIME, _loud, "pointwise_noise, or undecided", (0.6,), "of its spread",
        fits=_one_way,
    ),
    Change("as it is", NAMES, unchanged, "what is true of the base"),
)  # fmt: skip
