"""Forms of the action: the same motion as positions, differences, velocities, normalised; names."""

from dataclasses import replace

import numpy as np

from benchmarks.audit_real.changes.change import FORM, LAYOUT, NAMES, Change, Place, published
from benchmarks.audit_real.recording import Array, Episode, Recording

SAME = "nothing: the verdict of the same recording without it"
LAYOUTS = {
    "as LeRobot v2.1": "lerobot2", "as LeRobot v3": "lerobot3", "as robomimic": "robomimic",
    "as Parquet files": "parquet_files", "as one Parquet table": "parquet",
}  # fmt: skip
WORDS = (
    "amble", "birch", "cove", "dune", "ember", "fjord", "glade", "heron", "islet", "jetty", "kelp",
    "larch", "moor", "nook", "oriel", "pique", "quill", "reed", "shale", "tarn", "umber", "vale",
    "weir", "xylem", "yarrow", "zephyr", "alder", "brook", "crag", "dell", "elm", "fen", "gorse",
    "heath", "ivy", "juniper", "knoll", "loam", "mead", "nettle", "oak", "pine",
)  # fmt: skip


def _steps(episode: Episode) -> Array:
    return np.diff(episode.command, axis=0, prepend=episode.command[:1])


def _in_form(recording: Recording, form: str) -> Recording:
    paired = recording.paired

    def change(episode: Episode) -> Episode:
        action = episode.command.copy()
        if form != "absolute":
            steps = _steps(episode)
            action[:, paired] = steps[:, paired]
        if form == "velocity":
            action[:, paired] *= recording.rate_hz
        return replace(episode, action=action)

    changed = replace(recording.each(change), form=form)
    if form != "normalised":
        return changed
    steps = np.concatenate([e.action[:, paired] for e in changed.episodes])
    largest = np.quantile(np.abs(steps), 0.998, axis=0) + 1e-12

    def normal(episode: Episode) -> Episode:
        action = episode.action.copy()
        action[:, paired] = np.clip(action[:, paired] / largest, -1.0, 1.0)
        return replace(episode, action=action)

    return changed.each(normal)


def _form(name: str, form: str, like_state: bool) -> Change:
    def apply(recording: Recording, place: Place, strength: float) -> Recording:
        changed = _in_form(recording, form)
        return _like_state(changed) if like_state else _action_unnamed(changed)

    return Change(
        name,
        FORM,
        apply,
        SAME,
        fits=lambda r: r.form != form and bool(r.paired) and not published(r),
    )


def _like_state(recording: Recording) -> Recording:
    """Each action bears the name of the observed number that it moves."""
    names = list(recording.action_names) or [""] * len(recording.follows)
    for k, place in enumerate(recording.follows):
        if place is not None and recording.names[place[0]]:
            names[k] = recording.names[place[0]][place[1]]
    return replace(recording, action_names=tuple(names) if all(names) else ())


def _action_unnamed(recording: Recording) -> Recording:
    return replace(recording, action_names=())


def _unnamed(recording: Recording, place: Place, strength: float) -> Recording:
    names = dict.fromkeys(recording.names, ())
    return replace(recording, action_names=(), names=names)


def _nonsense(recording: Recording, place: Place, strength: float) -> Recording:
    words = [WORDS[k] for k in place.rng.permutation(len(WORDS))]

    def drawn(names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(words.pop() if words else f"w{k}" for k in range(len(names)))

    return replace(
        recording,
        names={name: drawn(parts) for name, parts in recording.names.items()},
        action_names=drawn(recording.action_names),
    )


def _gripper_only(recording: Recording, place: Place, strength: float) -> Recording:
    """The leader's numbers have names of their own; one of them is the follower's."""
    names = [f"leader_axis_{k}" for k in range(len(recording.follows))]
    like = _like_state(recording).action_names
    names[recording.paired[-1]] = like[recording.paired[-1]]
    return replace(recording, action_names=tuple(names))


def _leader(recording: Recording, place: Place, strength: float) -> Recording:
    """A leader of another build under the follower's names: zeros elsewhere, a gain near one."""
    paired = recording.paired
    offset = strength * recording.scale * place.rng.uniform(-1.0, 1.0, len(paired))
    gain = place.rng.uniform(0.92, 1.08, len(paired))

    def change(episode: Episode) -> Episode:
        action = episode.action.copy()
        action[:, paired] = gain * action[:, paired] + offset
        return replace(episode, action=action)

    return _like_state(recording.each(change))


def _permuted(recording: Recording, place: Place, strength: float) -> Recording:
    order = place.rng.permutation(len(recording.follows))
    seen = {n: place.rng.permutation(v.shape[1]) for n, v in recording.episodes[0].seen.items()}
    new_place = {n: np.argsort(order_) for n, order_ in seen.items()}
    follows = tuple(
        None if (at := recording.follows[k]) is None else (at[0], int(new_place[at[0]][at[1]]))
        for k in order
    )
    changed = recording.each(
        lambda e: replace(
            e, action=e.action[:, order], command=e.command[:, order],
            seen={n: v[:, seen[n]] for n, v in e.seen.items()},
        )
    )  # fmt: skip
    names = {n: tuple(v[k] for k in seen[n]) if v else () for n, v in recording.names.items()}
    acts = tuple(recording.action_names[k] for k in order) if recording.action_names else ()
    return replace(changed, follows=follows, names=names, action_names=acts)


def _all_names(recording: Recording) -> list[tuple[str, ...]]:
    return [*recording.names.values(), recording.action_names]


def _layout(name: str, layout: str) -> Change:
    """Written by another recorder, under the names that it gives its columns."""

    def apply(recording: Recording, place: Place, strength: float) -> Recording:
        before = list(recording.names)
        after = [_column(column, k, layout) for k, column in enumerate(before)]
        new = dict(zip(before, after, strict=True))
        changed = recording.each(
            lambda e: replace(
                e, seen={new[n]: v for n, v in e.seen.items()},
                time_s=np.arange(len(e)) / recording.rate_hz if e.time_s is None else e.time_s,
            )
        )  # fmt: skip
        nameless = layout == "robomimic"
        return replace(
            changed, layout=layout,
            names={new[n]: () if nameless else parts for n, parts in recording.names.items()},
            action_names=() if nameless else recording.action_names,
            follows=tuple(None if at is None else (new[at[0]], at[1]) for at in recording.follows),
        )  # fmt: skip

    return Change(
        name, LAYOUT, apply, SAME,
        fits=lambda r: r.layout != layout and (layout != "robomimic" or not r.episodes[0].rows),
    )  # fmt: skip


def _column(name: str, place: int, layout: str) -> str:
    word = name.replace("observation.", "").replace("obs/", "")
    if layout == "robomimic":
        return f"obs/{word}"
    if layout.startswith("lerobot"):
        return "observation.state" if place == 0 else f"observation.{word}"
    return f"obs_{word}"


def _named(recording: Recording) -> bool:
    return bool(_like_state(recording).action_names)


FORMS = (
    _form("absolute", "absolute", True),
    _form("delta", "delta", False),
    _form("delta, names of the state", "delta", True),
    _form("velocity", "velocity", False),
    _form("velocity, names of the state", "velocity", True),
    _form("normalised", "normalised", False),
    Change(
        "leader of another build", FORM, _leader, SAME, (0.05, 0.15), "offset, of the ways apart",
        fits=lambda r: r.form == "absolute" and _named(r),
    ),
    Change(
        "only one name shared", NAMES, _gripper_only, SAME,
        fits=lambda r: r.form == "absolute" and _named(r),
    ),
    Change("names absent", NAMES, _unnamed, SAME, fits=lambda r: any(map(any, _all_names(r)))),
    Change("names are nonsense", NAMES, _nonsense, SAME, fits=lambda r: bool(r.action_names)),
    Change("columns in another order", NAMES, _permuted, SAME, fits=lambda r: not published(r)),
    *(_layout(name, layout) for name, layout in LAYOUTS.items()),
)  # fmt: skip
