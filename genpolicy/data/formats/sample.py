"""Columns of a few episodes, and what they look like: channels, components, units."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.formats.contract import ActionSource, ChannelSource, selectors
from genpolicy.data.formats.source import Column, RawEpisode, as_float
from genpolicy.data.formats.units import guess_unit, is_wrapped_angle, stated_unit, turns

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

SUFFIX = {"m": "m", "mm": "m", "cm": "m", "rad": "rad", "deg": "rad", "px": "px", "N": "n"}
# Episodes in which an angle is so many times as large as in most may be in degrees; then they are
# larger by the degrees of a radian, within a factor.
APART, ALIKE = 10.0, 1.5
PREFIXES = ("observation.", "observations.", "obs/", "obs.", "obs_", "data/")


@dataclass(frozen=True)
class Sample:
    """Some episodes, read whole, to guess from.

    Attributes:
        episodes: The episodes.
        number: Which of them each row belongs to. Shape (n,).
        one_clock: Whether one clock ran on through all episodes of the recordings.
    """

    episodes: list[RawEpisode]
    number: Integers
    one_clock: bool = False

    def values(self, column: str) -> NDArray[np.generic]:
        """All rows of a column."""
        return np.concatenate([episode.columns[column] for episode in self.episodes])

    def numbers(self, column: str) -> Array:
        """All rows of a column as numbers. Shape (n, width)."""
        return as_float(self.values(column)).reshape(len(self.number), -1)

    def usual(self, values: Array) -> NDArray[np.bool_]:
        """Rows without the episodes in which an angle is larger by a turn's degrees than in most.

        Some that are in another unit must not decide the unit of all. Episodes in which a number
        rests at zero have no unit.
        """
        everything = np.ones(len(values), dtype=bool)
        edges = np.flatnonzero(np.diff(self.number, prepend=self.number[:1] - 1))
        if not len(edges):
            return everything
        sizes = np.maximum.reduceat(np.nan_to_num(np.abs(values)), edges)
        moving = sizes[sizes > 0.0]
        limit = APART * float(np.median(moving)) if len(moving) else np.inf
        large, common = moving[moving > limit], moving[moving <= limit]
        if not len(large):
            return everything
        factor = float(np.median(large) / np.median(common))
        if abs(np.log(factor / (180.0 / np.pi))) > np.log(ALIKE):
            return everything
        kept = sizes <= limit
        return np.asarray(np.repeat(kept, np.diff(np.append(edges, len(values)))))

    def selected(self, columns: list[str]) -> Array:
        """The numbers that selectors choose. Shape (n, width)."""
        chosen = selectors(columns, where="contract")
        return np.stack([self.numbers(s.column)[:, s.element or 0] for s in chosen], axis=1)


@dataclass(frozen=True)
class Atom:
    """One number of a row.

    Attributes:
        group: What it belongs to: its vector column, or the common beginning of scalar names.
        stream: The sensor that it is taken to come from.
        component: Its name within the group.
        selector: Where it stands.
        unit: Stated or guessed unit.
        guessed: The unit was guessed.
        wrapped: An angle that jumps by a turn.
    """

    group: str
    stream: str
    component: str
    selector: str
    unit: str
    guessed: bool
    wrapped: bool


def action_of(columns: Sequence[Column], sample: Sample, notes: list[str]) -> ActionSource:
    """The action that the columns make, in their order."""
    atoms = [atom for column in columns for atom in _atoms(column, sample, notes)]
    # Scalar columns keep their whole name: an action has no channels to tell x from x.
    names = [a.component if "[" in a.selector else _word(a.selector) for a in atoms]
    for atom in atoms:
        if atom.wrapped:
            notes.append(f"The action's {atom.component} jumps by a turn, an angle not unwrapped.")
    return ActionSource(
        columns=_ranges([atom.selector for atom in atoms]),
        components=names,
        units=[atom.unit for atom in atoms],
        guessed=any(atom.guessed for atom in atoms),
    )


def channels_of(columns: Sequence[Column], sample: Sample, notes: list[str]) -> list[ChannelSource]:
    """One channel per group and unit; an angle that jumps is written as cosine and sine."""
    groups: dict[tuple[str, str, bool], list[Atom]] = {}
    for column in columns:
        for atom in _atoms(column, sample, notes):
            groups.setdefault((atom.group, atom.unit, atom.wrapped), []).append(atom)
    channels: list[ChannelSource] = []
    for (group, unit, wrapped), atoms in groups.items():
        parts = [atom.component for atom in atoms]
        if wrapped:
            notes.append(f"{group}: {', '.join(parts)} jumps by a turn: written as cos and sin.")
            parts = [f"{part}_{turn}" for part in parts for turn in ("cos", "sin")]
        channels.append(
            ChannelSource(
                name=_channel_name(group, "1" if wrapped else unit, {c.name for c in channels}),
                columns=_ranges([atom.selector for atom in atoms]),
                components=parts,
                unit="rad" if wrapped else unit,
                guessed=any(atom.guessed for atom in atoms),
                stream=atoms[0].stream,
                transform="cos_sin" if wrapped else "none",
            )
        )
    return channels


def _atoms(column: Column, sample: Sample, notes: list[str]) -> list[Atom]:
    values = sample.numbers(column.name)
    width = values.shape[1]
    names = list(column.components)
    group = stream = _word(column.name)
    if column.width is None:
        group, component = _parted(column.name)
        stream, names = group, [component]
    elif len(names) != width or len(set(names)) != width:
        names = [f"{group}_{i}" for i in range(width)]
    atoms: list[Atom] = []
    for i, name in enumerate(names):
        kept = sample.usual(values[:, i])
        usual, number = values[kept, i], sample.number[kept]
        unit = column.unit or guess_unit(column.name, "" if name == group else name, usual)
        said = stated_unit(name) or stated_unit(column.name)
        if not column.unit and said not in (None, unit):
            notes.append(
                f"{column.name}: {name} says {said}, which its numbers are too large for: its unit "
                "is unknown."
            )
        wrapped = unit in ("rad", "unknown") and is_wrapped_angle(usual, number)
        if unit == "rad" and not wrapped and turns(usual) > 1.0:
            notes.append(f"{column.name}: {name} spans {turns(usual):.1f} turns.")
        selector = column.name if column.width is None else f"{column.name}[{i}]"
        atoms.append(Atom(group, stream, name, selector, unit, not column.unit, wrapped))
    return atoms


def _parted(name: str) -> tuple[str, str]:
    """Group and component of a scalar column: `tcp_x_m` is `x` of `tcp`, `x_m` `x` of `state`."""
    word = _word(name)
    body = word.rsplit("_", 1)[0] if stated_unit(word) is not None else word
    group, _, component = body.rpartition("_")
    if group and component:
        return group, component
    return ("state" if len(body) == 1 else body), body


def _ranges(selected: Sequence[str]) -> list[str]:
    """`a[0]`, `a[1]`, `a[2]` as `a[0:3]`."""
    result: list[str] = []
    for text in selected:
        name, bracket, rest = text.partition("[")
        before = selectors(result[-1:], where="contract") if result else []
        element = int(rest[:-1]) if bracket else None
        last = before[-1] if before else None
        follows = last is not None and last.column == name and last.element is not None
        if element is not None and follows and last is not None and last.element == element - 1:
            result[-1] = f"{name}[{before[0].element}:{element + 1}]"
        else:
            result.append(text)
    return result


def _channel_name(group: str, unit: str, used: set[str]) -> str:
    suffix = SUFFIX.get(unit, "")
    base = group if not suffix or group.endswith(f"_{suffix}") else f"{group}_{suffix}"
    name, number = base, 2
    while name in used:
        name, number = f"{base}_{number}", number + 1
    return name


def _word(name: str) -> str:
    """A column's name as an identifier: `observation.state` is `state`, `obs/eef_pos` `eef_pos`."""
    for prefix in PREFIXES:
        name = name.removeprefix(prefix)
    word = "".join(letter if letter.isalnum() and letter.isascii() else "_" for letter in name)
    word = word.strip("_") or "column"
    return word if word[0].isalpha() else f"c_{word}"
