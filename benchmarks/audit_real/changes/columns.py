"""Columns: what decides, recorded, observed or absent; constants, noise, outcomes."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.audit_real.changes.change import (
    COLUMNS,
    Change,
    Place,
    free,
    steady,
    unchanged,
)
from benchmarks.audit_real.changes.forms import SAME
from benchmarks.audit_real.recording import Episode, Recording

# Column, its values by way, and the words that may name it.
TEXTS: dict[str, tuple[str, ...]] = {
    "task": ("put it round the near side", "put it round the far side", "take the middle",
             "go as you like"),
    "scenario": ("A", "B", "C", "D"),
    "hand": ("left", "right", "both", "none"),
    "operator": ("ada", "ben", "cleo", "dov"),
    "zq7": ("k2", "w9", "p0", "m4"),
    "instruction_id": ("0017", "0018", "0019", "0020"),
    "subtask": ("a", "b", "c", "d"),
}  # fmt: skip
NOISE_COLUMNS = 30
# Recordings whose maker can begin on one side.
BY_START = ("pushing", "can_pillar", "planned_reach")
FIDELITY = "share of episodes that obey"


def _obeyed(recording: Recording, place: Place, fidelity: float) -> np.ndarray:
    """What the column says of each episode: its way, but where it is not obeyed. Shape (E,)."""
    said = recording.modes
    other = said + 1 + place.rng.integers(0, recording.truth.modes - 1, len(said))
    away = np.zeros(len(said), dtype=bool)
    away[place.rng.permutation(len(said))[: round((1.0 - fidelity) * len(said))]] = True
    return np.where(away, other % recording.truth.modes, said)


def _fact(name: str, values: tuple[str, ...]) -> Change:
    def apply(recording: Recording, place: Place, fidelity: float) -> Recording:
        said = _obeyed(recording, place, fidelity)
        episodes = tuple(
            replace(e, facts={**e.facts, name: values[int(k)]})
            for e, k in zip(recording.episodes, said, strict=True)
        )
        names = (name, "phase") if name == "subtask" else (name,)
        return replace(recording, episodes=episodes).true(
            decided_by=name,
            names=names,
            undecided=recording.truth.undecided if recording.real else "",
        )

    return Change(
        f"{name} decides",
        COLUMNS,
        apply,
        f"hidden_state({name})",
        (1.0, 0.95),
        FIDELITY,
        fits=lambda r: free(r) and steady(r) and r.layout != "zarr",
    )


def _row(name: str, value: Callable[[int, np.random.Generator, int], np.ndarray]) -> Change:
    """What decides as a number in every row."""

    def apply(recording: Recording, place: Place, fidelity: float) -> Recording:
        said = _obeyed(recording, place, fidelity)
        episodes = tuple(
            replace(e, rows={**e.rows, name: value(int(k), place.rng, len(e))})
            for e, k in zip(recording.episodes, said, strict=True)
        )
        return replace(recording, episodes=episodes).true(
            decided_by=name,
            names=(name,),
            undecided=recording.truth.undecided if recording.real else "",
        )

    return Change(
        f"{name} decides, in every row", COLUMNS, apply, f"hidden_state({name})", (1.0, 0.95),
        FIDELITY, fits=lambda r: free(r) and steady(r) and r.layout != "robomimic",
    )  # fmt: skip


def _observed(recording: Recording, place: Place, strength: float) -> Recording:
    """What decides now, and what will decide next where an episode chooses again.

    A chunk reaches over the row in which the next choice is carried out: of a cue of now alone
    two ways follow there, and no policy could see which.
    """
    first = next(iter(recording.names))
    name = {"obs": "obs_cue", "obs/": "obs/cue"}.get(first[:4].rstrip("_r"), "observation.cue")
    name = "obs/cue" if first.startswith("obs/") else name
    width, again = recording.truth.modes, not steady(recording)

    def change(episode: Episode) -> Episode:
        shown = np.eye(width)[episode.mode % width]
        if again:
            shown = np.concatenate([shown, _next_shown(episode.mode, width)], axis=1)
        rows = {k: v for k, v in episode.rows.items() if k != recording.truth.decided_by}
        return replace(episode, seen={**episode.seen, name: shown}, rows=rows)

    changed = recording.each(change)
    cues = tuple(f"cue_{k}" for k in range(width * (1 + again)))
    names = {**recording.names, name: cues}
    if recording.layout == "robomimic" or not recording.names[first]:
        names[name] = ()
    return replace(changed, names=names).true(observed=True, decided_by="cue", undecided="")


def _next_shown(mode: np.ndarray, width: int) -> np.ndarray:
    """The way after the next change of way in each row; nothing where there is none. (T, width)."""
    begins = np.flatnonzero(np.diff(mode)) + 1
    following = np.searchsorted(begins, np.arange(len(mode)), side="right")
    shown = np.concatenate([np.eye(width)[mode[begins] % width], np.zeros((1, width))])
    return shown[following]


def _absent(recording: Recording, place: Place, strength: float) -> Recording:
    name = recording.truth.decided_by
    return recording.each(
        lambda e: replace(e, rows={k: v for k, v in e.rows.items() if k != name})
    ).true(
        decided_by="past", names=(),
        undecided="nobody recorded what decides: the same data as a free choice",
    )  # fmt: skip


def _constant(recording: Recording, place: Place, strength: float) -> Recording:
    """A commanded number that hardly varies, and the observed one that holds it."""
    paired = [place_ for place_ in recording.follows if place_ is not None]
    column = paired[0][0]
    width = recording.episodes[0].seen[column].shape[1]
    height = float(place.rng.uniform(0.1, 0.3)) * (recording.scale * 5.0)
    told = height if recording.form == "absolute" else 0.0

    def change(episode: Episode) -> Episode:
        jitter = strength * recording.scale * place.rng.normal(size=(len(episode), 1))
        held = height + 3e-3 * recording.scale * place.rng.normal(size=(len(episode), 1))
        return replace(
            episode,
            action=np.concatenate([episode.action, told + jitter], axis=1),
            command=np.concatenate([episode.command, height + jitter], axis=1),
            seen={**episode.seen, column: np.concatenate([episode.seen[column], held], axis=1)},
        )

    names = dict(recording.names)
    names[column] = (*names[column], "height") if names[column] else ()
    return replace(
        recording.each(change), names=names, follows=(*recording.follows, (column, width)),
        action_names=(*recording.action_names, "height") if recording.action_names else (),
    )  # fmt: skip


def _noise_observed(recording: Recording, place: Place, strength: float) -> Recording:
    first = next(iter(recording.names))
    name = "obs/extra" if first.startswith("obs/") else f"{first}_extra"
    changed = recording.each(
        lambda e: replace(e, seen={**e.seen, name: place.rng.normal(size=(len(e), NOISE_COLUMNS))})
    )
    reason = recording.truth.undecided or "thirty observed numbers without meaning hide who is near"
    return replace(changed, names={**recording.names, name: ()}).true(undecided=reason)


def _noise_recorded(recording: Recording, place: Place, strength: float) -> Recording:
    def change(episode: Episode) -> Episode:
        more = {f"note_{k:02d}": f"v{place.rng.integers(2 + k % 5)}" for k in range(NOISE_COLUMNS)}
        return replace(episode, facts={**episode.facts, **more})

    return recording.each(change)


def _no_outcomes(recording: Recording, place: Place, strength: float) -> Recording:
    return recording.each(
        lambda e: replace(e, facts={k: v for k, v in e.facts.items() if k != "success"})
    ).true(outcomes=False)


def _outcome_words(recording: Recording, place: Place, strength: float) -> Recording:
    return recording.each(
        lambda e: replace(
            e, facts={**e.facts, "success": "success" if e.facts["success"] else "failure"}
        )
    )


def _has_outcomes(recording: Recording) -> bool:
    return recording.truth.outcomes


DECIDED = (
    *(_fact(name, values) for name, values in TEXTS.items()),
    _row("latent", lambda way, rng, rows: np.full(rows, way)),
    _row("embedding", lambda way, rng, rows: np.full(rows, 1.7 * way + 0.2 * rng.normal())),
    Change(
        "what decides is observed", COLUMNS, _observed, "unimodal",
        fits=lambda r: r.truth.modes > 1 and not r.real,
    ),
    Change(
        "what decides is not recorded", COLUMNS, _absent,
        "hidden_state(unrecorded), or honestly undecided",
        fits=lambda r: r.truth.decided_by in r.episodes[0].rows,
    ),
    Change(
        "turns", COLUMNS, unchanged, "hidden_state(unrecorded): sides by session",
        fits=lambda r: free(r) and not r.real,
        plan=lambda plan, s: replace(plan, decided_by="order"),
    ),
    Change(
        "start decides", COLUMNS, unchanged, "unimodal, or hidden_state(start) where it is past",
        fits=lambda r: free(r) and r.name in BY_START,
        plan=lambda plan, s: replace(plan, decided_by="start"),
    ),
)  # fmt: skip

COLUMN_CHANGES = (
    Change(
        "constant commanded column", COLUMNS, _constant, SAME, (0.0, 1e-6, 1e-4),
        "its spread, of the ways apart", fits=lambda r: bool(r.paired),
    ),
    Change("30 observed columns of noise", COLUMNS, _noise_observed, f"{SAME}, or undecided"),
    Change(
        "30 recorded columns of noise", COLUMNS, _noise_recorded, SAME,
        fits=lambda r: r.layout != "zarr",
    ),
    Change("outcomes absent", COLUMNS, _no_outcomes, "validity is missing, modes are said",
           fits=_has_outcomes),
    Change("outcomes in words", COLUMNS, _outcome_words, SAME, fits=_has_outcomes),
    Change(
        "a way fails", COLUMNS, unchanged, "unimodal(one_valid_mode)", (0.6, 0.95),
        "share of its episodes that fail",
        fits=lambda r: _has_outcomes(r) and free(r) and r.name != "avoiding",
        plan=lambda plan, s: replace(plan, failing=s),
    ),
)  # fmt: skip
