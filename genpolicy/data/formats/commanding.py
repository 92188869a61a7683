"""The commands of a proposed contract: pairs, forms and units of the action, and what was odd."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.formats.commands import CommandForm
from genpolicy.data.formats.contract import SI, UNKNOWN_UNIT, ActionSource, ChannelSource
from genpolicy.data.formats.following import changes
from genpolicy.data.formats.forms import CHANGED, SAME_SCALE, Reading, added_up, read_forms
from genpolicy.data.formats.pairing import pair_by_name
from genpolicy.data.formats.quaternions import is_quaternion
from genpolicy.data.formats.sample import Sample
from genpolicy.data.formats.turning import turned

Array = NDArray[np.float64]

# What a reading of a rotation may leave unexplained more than the best one, and yet be taken first.
CLEARLY = 2.0


@dataclass(frozen=True)
class Commands:
    """What a proposal says of the action.

    Attributes:
        action: The action, with the units that its partners tell.
        pairing: Component to the observed number that it commands; None where none is found.
        by_numbers: Some pair was found in the numbers alone.
        forms: Form of every component.
        notes: What contradicts, a sentence each.
    """

    action: ActionSource
    pairing: dict[str, str] | None
    by_numbers: bool
    forms: dict[str, CommandForm]
    notes: tuple[str, ...]


def propose_commands(
    channels: Sequence[ChannelSource], action: ActionSource, sample: Sample, *, period_s: float
) -> Commands:
    """Pairs and forms of the action, from the numbers of a sample."""
    names, units, observed, parts = _observed(channels, sample)
    factors = np.array([SI.get(unit, (unit, 1.0))[1] for unit in action.units])
    commanded = sample.selected(action.columns) * factors
    named = {
        action.components.index(a): names.index(o)
        for a, o in _namesakes(channels, action).items()
        if names.index(o) not in parts
    }
    reading = read_forms(
        observed, commanded, sample.number, named=named, period_s=period_s, no_partner=parts
    )
    known = [units[name] for name in names]
    reading = _with_turns(reading, turned(channels, sample), commanded, sample, period_s=period_s)
    reading = _whole_rotations(reading, commanded)
    told = _with_units(action, reading, known, period_s)
    pairs = {
        a: o
        for a, o in reading.pairs.items()
        if not reading.forms[a].is_plain or _si(told.units[a]) == _si(known[o])
    }
    notes = _notes(action.components, names, reading, named)
    return Commands(
        action=told,
        pairing={action.components[a]: names[o] for a, o in pairs.items()} or None,
        by_numbers=bool(set(pairs) - reading.by_name),
        forms=dict(zip(action.components, reading.forms, strict=True)),
        notes=notes,
    )


def _namesakes(channels: Sequence[ChannelSource], action: ActionSource) -> dict[str, str]:
    """Pairs of one name, and of one unit where the action's was not guessed from its range."""
    if action.guessed:
        units = [UNKNOWN_UNIT] * len(action.units)
        action = action.model_copy(update={"units": units})
        channels = [
            c if c.transform != "none" else c.model_copy(update={"unit": UNKNOWN_UNIT})
            for c in channels
        ]
    return pair_by_name(channels, action) or {}


def _observed(
    channels: Sequence[ChannelSource], sample: Sample
) -> tuple[list[str], dict[str, str], Array, list[int]]:
    """The observed numbers in dataset units, angles that jump left out, and parts of rotations."""
    plain = [channel for channel in channels if channel.transform == "none"]
    names = [f"{c.name}.{component}" for c in plain for component in c.components]
    units = {f"{c.name}.{part}": c.unit for c in plain for part in c.components}
    if not plain:
        return [], {}, np.zeros((len(sample.number), 0)), []
    values = np.concatenate([sample.selected(c.columns) * c.factor for c in plain], axis=1)
    parts: list[int] = []
    begin = 0
    for channel in plain:
        width = len(channel.components)
        parts += [begin + part for part in _of_rotations(values[:, begin : begin + width])]
        begin += width
    return names, units, values, parts


def _of_rotations(values: Array) -> list[int]:
    """Columns that are parts of a quaternion."""
    found: set[int] = set()
    for first in range(values.shape[1] - 3):
        if is_quaternion(values[:, first : first + 4]):
            found |= set(range(first, first + 4))
    return sorted(found)


def _whole_rotations(reading: Reading, commanded: Array) -> Reading:
    """A commanded quaternion says where, whatever one of its parts alone seems to change."""
    parts = set(_of_rotations(commanded))
    forms = [CommandForm() if a in parts else form for a, form in enumerate(reading.forms)]
    pairs = {a: o for a, o in reading.pairs.items() if a not in parts}
    return replace(reading, forms=tuple(forms), pairs=pairs)


def _with_turns(
    reading: Reading, seen: Array, commanded: Array, sample: Sample, *, period_s: float
) -> Reading:
    """What moves nothing by itself may turn something: then it is a change without a partner."""
    unknown = [a for a, form in enumerate(reading.forms) if form.form == "unknown"]
    if not unknown or not seen.shape[1]:
        return reading
    found = changes(seen, commanded[:, unknown], sample.number)
    holds = (found.explained >= CHANGED) & found.beyond
    forms = list(reading.forms)
    for number, a in enumerate(unknown):
        if holds[number].any():
            left = np.where(holds[number], 1.0 - found.explained[number], np.inf)
            # About the axes of the base, unless another reading is clearly better.
            best = int(np.flatnonzero(left <= CLEARLY * left.min() + 1e-9)[0])
            forms[a] = added_up(float(found.gain[number, best]), period_s)
    return replace(reading, forms=tuple(forms))


def _with_units(
    action: ActionSource, reading: Reading, known: list[str], period_s: float
) -> ActionSource:
    """Units that the partners tell, where the recordings state none."""
    units = list(action.units)
    for a, o in reading.pairs.items():
        form = reading.forms[a]
        # A unit with a factor was used to compare the numbers: it stays.
        if units[a] in SI or not (action.guessed or units[a] == UNKNOWN_UNIT):
            continue
        unit = _si(known[o])
        row_gain = abs(form.gain)
        if form.is_plain or (form.form == "change" and SAME_SCALE[0] <= row_gain <= SAME_SCALE[1]):
            units[a] = unit
        elif form.form == "rate":
            units[a] = UNKNOWN_UNIT if unit == UNKNOWN_UNIT else f"{unit}/s"
        else:
            units[a] = UNKNOWN_UNIT
    return action.model_copy(update={"units": units})


def _si(unit: str) -> str:
    return SI.get(unit, (unit, 1.0))[0]


def _notes(
    components: list[str], names: list[str], reading: Reading, named: dict[int, int]
) -> tuple[str, ...]:
    notes: list[str] = []
    if reading.contradicted:
        swapped = ", ".join(
            f"{names[named[b]]} answers {components[a]}" for a, b in reading.contradicted
        )
        notes.append(f"Names and numbers contradict: {swapped}. Names stand, for the audit.")
    strange = [
        f"{components[a]} ({names[named[a]]})"
        for a in reading.strangers
        if a not in reading.by_name
    ]
    if strange:
        notes.append(f"Bears the name of what it does not command: {', '.join(strange)}.")
    return tuple(notes)
