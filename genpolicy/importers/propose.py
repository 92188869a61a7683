"""A contract proposed from the recordings: names as given, units and pairs guessed and marked."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from genpolicy.dataset.assemble import Refusal
from genpolicy.errors import BadInputError, ContractError
from genpolicy.importers.contract import (
    ActionSource,
    ChannelSource,
    Format,
    Frozen,
    ImportContract,
    Labels,
    contract_of,
)
from genpolicy.importers.pairing import are_differences, pair_by_name, pair_by_numbers
from genpolicy.importers.source import Column, RawEpisode, Source, as_float
from genpolicy.importers.units import (
    guess_unit,
    is_wrapped_angle,
    runs_of_one_unit,
    tokens,
    turns,
)

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

SAMPLE_EPISODES = 12
SAMPLE_LOOKED_AT = 40
DEFAULT_RATE_HZ = 10.0
SHORTEST_DEMONSTRATION_S = 0.5
FEWEST_ROWS, MOST_ROWS = 4, 16
LONGEST_GAP_S = 0.25
LONGEST_GAP_ROWS = 3.0
FROZEN_S = 2.0
FROZEN_SHARE = 0.1
EPOCH_S = 1e6
TIME_UNITS = {"ns": 1e9, "us": 1e6, "ms": 1e3}
ACTION_NAMES = ("action", "actions", "command", "cmd", "target")


@dataclass(frozen=True)
class Sample:
    """Some episodes, read whole, to guess from.

    Attributes:
        episodes: The episodes.
        number: Which of them each row belongs to. Shape (n,).
    """

    episodes: list[RawEpisode]
    number: Integers

    def values(self, column: str) -> NDArray[np.generic]:
        """All rows of a column."""
        return np.concatenate([episode.columns[column] for episode in self.episodes])

    def numbers(self, column: str) -> Array:
        """All rows of a column as numbers. Shape (n, width)."""
        return as_float(self.values(column)).reshape(len(self.number), -1)


def propose_contract(source: Source, kind: Format, *, task: str | None = None) -> ImportContract:
    """What the recordings say of themselves, and a marked guess where they say nothing.

    Raises:
        BadInputError: No readable episode, or no action or no observation among the columns.
    """
    labels = source.labels
    actions, observed = _roles(source, labels)
    sample = _sample(source, [c.name for c in (*actions, *observed)], labels)
    observed = tuple(c for c in observed if sample.numbers(c.name).shape[1] > 0)
    notes: list[str] = list(source.notes)
    rate_hz, rate_guessed, unit = _rate(source, sample, labels, notes)
    action = _action(actions, sample)
    channels = _channels(observed, sample, notes)
    pairing, by_numbers = _pairing(channels, action, sample, notes)
    first = _first_times(sample, labels)
    values = ImportContract(
        format=kind,
        task=task or _task(source),
        rate_hz=rate_hz,
        rate_guessed=rate_guessed,
        channels=channels,
        action=action,
        pairing=pairing,
        pairing_guessed=by_numbers,
        labels=labels,
        time_unit=unit,  # type: ignore[arg-type]  # one of TIME_UNITS or s
        time_origin="recording" if len(set(first)) == len(first) > 1 else "episode",
        minimum_rows=int(
            np.clip(np.ceil(SHORTEST_DEMONSTRATION_S * rate_hz), FEWEST_ROWS, MOST_ROWS)
        ),
        maximum_gap_s=round(max(LONGEST_GAP_S, LONGEST_GAP_ROWS / rate_hz), 6),
        frozen=_frozen(channels, action, pairing, sample),
        notes=list(dict.fromkeys(notes)),
    )
    return contract_of(values.model_dump(), where="the proposed contract")


def _roles(source: Source, labels: Labels) -> tuple[tuple[Column, ...], tuple[Column, ...]]:
    """Which columns are the action, and which the observation."""
    taken = set(labels.named().values())
    numeric = [
        c
        for c in source.columns
        if c.kind == "number" and not c.per_episode and c.name not in taken
    ]
    actions = [c for c in numeric if _is_action(c.name)]
    exact = [c for c in actions if tokens(c.name)[-1:] in (["action"], ["actions"])]
    actions = exact[:1] or actions
    observed = [c for c in numeric if c not in actions and not _is_action(c.name)]
    stated = [c for c in observed if {"observation", "obs", "state"} & set(tokens(c.name))]
    observed = stated or observed
    for found, what in ((actions, "an action"), (observed, "an observation")):
        if not found:
            raise ContractError(
                where=source.name,
                found=f"with the columns {[c.name for c in source.columns][:12]}",
                expected=f"one that is {what}",
                action="Write the contract by hand (docs/import.md) and give it with --contract.",
            )
    return tuple(actions), tuple(observed)


def _is_action(name: str) -> bool:
    words = tokens(name)
    return bool(words) and any(word in ACTION_NAMES for word in words[:1] + words[-1:])


def _sample(source: Source, columns: Sequence[str], labels: Labels) -> Sample:
    wanted = list(dict.fromkeys([*columns, *labels.named().values()]))
    episodes: list[RawEpisode] = []
    reason = "it holds no episode"
    for item in islice(source.episodes(wanted), SAMPLE_LOOKED_AT):
        if isinstance(item, Refusal):
            reason = item.reason
            continue
        if len(item.columns[columns[0]]):
            episodes.append(item)
        if len(episodes) == SAMPLE_EPISODES:
            break
    if not episodes:
        raise BadInputError(
            where=source.name,
            found=f"without a readable episode (first: {reason})",
            expected="at least one",
            action="Correct the recordings.",
        )
    lengths = [len(episode.columns[columns[0]]) for episode in episodes]
    return Sample(episodes, np.repeat(np.arange(len(lengths)), lengths))


def _action(columns: Sequence[Column], sample: Sample) -> ActionSource:
    selected, names, units, guessed = [], [], [], False
    for column in columns:
        components, chosen = _components(column, sample)
        values = sample.numbers(column.name)
        selected += chosen
        names += components
        units += [
            column.unit or guess_unit(column.name, component, values[:, i])
            for i, component in enumerate(components)
        ]
        guessed = guessed or not column.unit
    return ActionSource(columns=_ranges(selected), components=names, units=units, guessed=guessed)


def _channels(columns: Sequence[Column], sample: Sample, notes: list[str]) -> list[ChannelSource]:
    """One channel per column and unit; an angle that jumps is written as cosine and sine."""
    channels: list[ChannelSource] = []
    used: set[str] = set()
    for column in columns:
        components, selected = _components(column, sample)
        values = sample.numbers(column.name)
        units = []
        for i, component in enumerate(components):
            unit = column.unit or guess_unit(column.name, component, values[:, i])
            wrapped = unit in ("rad", "unknown") and is_wrapped_angle(values[:, i], sample.number)
            units.append("rad wrapped" if wrapped else unit)
            if unit == "rad" and not wrapped and turns(values[:, i]) > 1.0:
                notes.append(f"{column.name}: {component} spans {turns(values[:, i]):.1f} turns.")
        for start, stop in runs_of_one_unit(units):
            unit = units[start].removesuffix(" wrapped")
            wrapped = unit != units[start]
            parts = components[start:stop]
            name = _channel_name(column.name, unit, used)
            used.add(name)
            if wrapped:
                notes.append(f"{', '.join(parts)} jumps by a turn: written as cosine and sine.")
                parts = [f"{turn}_{part}" for part in parts for turn in ("cos", "sin")]
            channels.append(
                ChannelSource(
                    name=name,
                    columns=_ranges(selected[start:stop]),
                    components=parts,
                    unit=unit,
                    guessed=not column.unit,
                    stream=_word(column.name),
                    transform="cos_sin" if wrapped else "none",
                )
            )
    return channels


def _components(column: Column, sample: Sample) -> tuple[list[str], list[str]]:
    """Name and selector of each number of a column."""
    width = sample.numbers(column.name).shape[1]
    if column.width is None:
        return [_word(column.name)], [column.name]
    names = list(column.components)
    if len(names) != width or len(set(names)) != width:
        names = [f"{_word(column.name)}_{i}" for i in range(width)]
    return names, [f"{column.name}[{i}]" for i in range(width)]


def _ranges(selected: Sequence[str]) -> list[str]:
    """`a[0]`, `a[1]`, `a[2]` as `a[0:3]`."""
    result: list[str] = []
    run: tuple[str, int, int] | None = None
    for text in [*selected, ""]:
        name, _, rest = text.partition("[")
        index = int(rest[:-1]) if rest else -1
        if run is not None and rest and run[0] == name and run[2] == index:
            run = (name, run[1], index + 1)
            continue
        if run is not None:
            single = run[2] - run[1] == 1
            result.append(f"{run[0]}[{run[1]}]" if single else f"{run[0]}[{run[1]}:{run[2]}]")
        run = (name, index, index + 1) if rest else None
        if text and not rest:
            result.append(text)
    return result


def _pairing(
    channels: Sequence[ChannelSource], action: ActionSource, sample: Sample, notes: list[str]
) -> tuple[dict[str, str] | None, bool]:
    observed, names = _matrix(channels, sample)
    commanded = _selected(action.columns, sample)
    pairing = pair_by_name(channels, action)
    if pairing is not None:
        left = [action.components.index(name) for name in pairing]
        right = [names.index(name) for name in pairing.values()]
        if are_differences(observed[:, right], commanded[:, left], sample.number):
            notes.append("The action follows the change of what bears its name, not its value.")
            return None, False
        if len(pairing) < len(action.components):
            rest = [name for name in action.components if name not in pairing]
            notes.append(f"Nothing observed bears the name of the action's {', '.join(rest)}.")
        return pairing, False
    pairs = pair_by_numbers(observed, commanded, sample.number)
    units = _units(channels)
    if pairs is None:
        return None, False
    found = {action.components[a]: names[o] for a, o in pairs if units[names[o]] == action.units[a]}
    return found or None, bool(found)


def _units(channels: Sequence[ChannelSource]) -> dict[str, str]:
    return {f"{c.name}.{part}": c.unit for c in channels for part in c.components}


def _matrix(channels: Sequence[ChannelSource], sample: Sample) -> tuple[Array, list[str]]:
    """The observed numbers as recorded, angles that jump left out, and their names."""
    plain = [channel for channel in channels if channel.transform == "none"]
    if not plain:
        return np.zeros((len(sample.number), 0)), []
    names = [f"{c.name}.{component}" for c in plain for component in c.components]
    return np.concatenate([_selected(c.columns, sample) for c in plain], axis=1), names


def _selected(columns: list[str], sample: Sample) -> Array:
    from genpolicy.importers.contract import selectors  # noqa: PLC0415

    parts = [
        sample.numbers(s.column)[:, s.element or 0] for s in selectors(columns, where="contract")
    ]
    return np.stack(parts, axis=1)


def _rate(
    source: Source, sample: Sample, labels: Labels, notes: list[str]
) -> tuple[float, bool, str]:
    """Rate, whether it is a guess, and the unit of the clock."""
    unit, measured = "s", None
    if labels.time is not None:
        times = as_float(sample.values(labels.time)).reshape(-1)
        steps = np.diff(times)[np.diff(sample.number) == 0]
        steps = steps[np.isfinite(steps) & (steps > 0)]
        unit = _time_unit(labels.time, times, steps)
        if len(steps):
            measured = TIME_UNITS.get(unit, 1.0) / float(np.median(steps))
    if source.rate_hz is not None:
        if measured is not None and not abs(measured / source.rate_hz - 1.0) <= 0.05:
            notes.append(
                f"The recordings state {source.rate_hz:g} Hz, their clock says {measured:.4g} Hz."
            )
        return source.rate_hz, False, unit
    if measured is not None:
        return float(f"{measured:.4g}"), False, unit
    return DEFAULT_RATE_HZ, True, unit


def _time_unit(name: str, times: Array, steps: Array) -> str:
    ends = tokens(name)[-1]
    if ends in TIME_UNITS:
        return ends
    if not len(steps) or np.median(steps) < 20.0:
        return "s"
    # A row every 20 s and more would be no control: the clock counts smaller units.
    return "ns" if np.median(steps) >= 1e5 else "ms"


def _first_times(sample: Sample, labels: Labels) -> list[float]:
    if labels.time is None:
        return []
    return [float(episode.columns[labels.time][0]) for episode in sample.episodes]


def _frozen(
    channels: Sequence[ChannelSource],
    action: ActionSource,
    pairing: dict[str, str] | None,
    sample: Sample,
) -> Frozen | None:
    """Only a stream that holds what the action commands must move with it."""
    paired = set((pairing or {}).values())
    streams = [c.stream for c in channels if paired & {f"{c.name}.{part}" for part in c.components}]
    spread = float(np.nanmax(np.ptp(_selected(action.columns, sample), axis=0)))
    if not streams or not FROZEN_SHARE * spread > 0:
        return None
    motion = float(f"{FROZEN_SHARE * spread:.3g}")
    return Frozen(streams=list(dict.fromkeys(streams)), seconds=FROZEN_S, motion=motion)


def _task(source: Source) -> str:
    return PurePath(source.name).stem or "unnamed"


def _channel_name(column: str, unit: str, used: set[str]) -> str:
    base = _word(column)
    suffix = {"m": "m", "mm": "m", "cm": "m", "rad": "rad", "deg": "rad", "px": "px"}.get(unit, "")
    if suffix and not base.endswith(f"_{suffix}"):
        base = f"{base}_{suffix}"
    name, number = base, 2
    while name in used:
        name, number = f"{base}_{number}", number + 1
    return name


def _word(name: str) -> str:
    """A column's name as an identifier: `observation.state` is `state`, `obs/eef_pos` `eef_pos`."""
    for prefix in ("observation.", "observations.", "obs/", "obs.", "data/"):
        name = name.removeprefix(prefix)
    word = "".join(letter if letter.isalnum() and letter.isascii() else "_" for letter in name)
    word = word.strip("_") or "column"
    return word if word[0].isalpha() else f"c_{word}"
