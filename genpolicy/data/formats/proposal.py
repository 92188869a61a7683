"""A contract proposed from the recordings: names as given, units and pairs guessed and marked."""

from collections.abc import Sequence
from itertools import islice
from pathlib import PurePath, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.assemble import Refusal
from genpolicy.data.formats.columns import BOOKKEEPING
from genpolicy.data.formats.commanding import Commands, propose_commands
from genpolicy.data.formats.contract import (
    SI,
    ChannelSource,
    Format,
    Frozen,
    ImportContract,
    Labels,
    contract_of,
)
from genpolicy.data.formats.sample import Sample, action_of, channels_of
from genpolicy.data.formats.sampling import labels_among, sample_episodes, settled
from genpolicy.data.formats.source import Column, Source, as_float
from genpolicy.data.formats.units import BULK, HANDS, tokens
from genpolicy.errors import BadInputError, ContractError

Array = NDArray[np.float64]

SAMPLE_LOOKED_AT = 40
DEFAULT_RATE_HZ = 10.0
SHORTEST_DEMONSTRATION_S = 0.5
FEWEST_ROWS, MOST_ROWS = 4, 16
LONGEST_GAP_S = 0.25
LONGEST_GAP_ROWS = 3.0
FROZEN_S = 2.0
FROZEN_SHARE = 0.1
OBSERVED = {"observation", "obs"}
STATED = {*OBSERVED, "state"}
TIME_UNITS = {"ns": 1e9, "us": 1e6, "ms": 1e3}
ACTION_WORDS = (("action", "actions"), ("command", "cmd", "commanded"), ("target", "goal"))


def propose_contract(source: Source, kind: Format, *, task: str | None = None) -> ImportContract:
    """What the recordings say of themselves, and a marked guess where they say nothing.

    Raises:
        BadInputError: No readable episode, or no action or no observation among the columns.
    """
    notes: list[str] = list(source.notes)
    labels = _rows_numbered(source, source.labels, notes)
    actions, observed = _roles(source, labels)
    sample = _sample(source, [c.name for c in (*actions, *observed)], labels)
    labels = settled(labels, sample.episodes, notes)
    observed = _without_labels(observed, sample, notes)
    rate_hz, rate_guessed, unit = _rate(source, sample, labels, notes)
    action = action_of(actions, sample, notes)
    channels = channels_of(observed, sample, notes)
    commands = propose_commands(channels, action, sample, period_s=1.0 / rate_hz)
    notes += commands.notes
    values = ImportContract(
        format=kind,
        task=task or _task(source),
        rate_hz=rate_hz,
        rate_guessed=rate_guessed,
        channels=channels,
        action=commands.action,
        pairing=commands.pairing,
        pairing_guessed=commands.by_numbers,
        forms=commands.forms,
        forms_guessed=True,
        labels=labels,
        time_unit=unit,  # type: ignore[arg-type]  # one of TIME_UNITS or s
        time_origin="recording" if sample.one_clock else "episode",
        minimum_rows=int(
            np.clip(np.ceil(SHORTEST_DEMONSTRATION_S * rate_hz), FEWEST_ROWS, MOST_ROWS)
        ),
        maximum_gap_s=round(max(LONGEST_GAP_S, LONGEST_GAP_ROWS / rate_hz), 6),
        frozen=_frozen(channels, commands, sample),
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
    actions: list[Column] = []
    for words in ACTION_WORDS:
        actions = actions or [c for c in numeric if _is_action(c.name, words)]
    exact = [c for c in actions if tokens(c.name)[-1:] in (["action"], ["actions"])]
    # One that is called so and no more is the whole of it; `arm_action`, `hand_action` are parts.
    whole = [c for c in exact if PurePosixPath(c.name).name in ("action", "actions")]
    actions = whole[:1] or exact or actions
    observed = [
        c
        for c in numeric
        if c not in actions
        and not _is_action(c.name, ACTION_WORDS[0])
        and not BOOKKEEPING & {*tokens(c.name)[:1], *tokens(c.name)[-1:]}
    ]
    stated = [c for c in observed if STATED & set(tokens(c.name))]
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


def _without_labels(
    observed: tuple[Column, ...], sample: Sample, notes: list[str]
) -> tuple[Column, ...]:
    """Without columns that look like labels, where no name says that they are observed.

    `observation.mode` says so; `planner_state` is called a state, and so is what a script is in.
    """
    named = [c for c in observed if not OBSERVED & {*tokens(c.name)[:1]}]
    if any(STATED & set(tokens(c.name)) for c in observed):
        called = [(c, tokens(c.name)) for c in named]
        named = [c for c, words in called if words[-1:] == ["state"] and not HANDS & {*words}]
    found = labels_among(named, sample.episodes)
    if not found or len(found) == len(observed):
        return observed
    notes.append(
        f"Taken as labels, not as observed: {', '.join(found)}. If the policy sees them, add them "
        "to the channels."
    )
    return tuple(c for c in observed if c.name not in found)


def _is_action(name: str, words: tuple[str, ...]) -> bool:
    parts = tokens(name) or [name]
    return parts[0] in words or parts[-1] in words


def _sample(source: Source, columns: Sequence[str], labels: Labels) -> Sample:
    found = sample_episodes(source, columns, labels)
    if not found.episodes:
        raise BadInputError(
            where=source.name,
            found=f"without a readable episode (first: {found.reason})",
            expected="at least one",
            action="Correct the recordings.",
        )
    lengths = [len(episode.columns[columns[0]]) for episode in found.episodes]
    number = np.repeat(np.arange(len(lengths)), lengths)
    return Sample(found.episodes, number, one_clock=found.one_clock)


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


def _rows_numbered(source: Source, labels: Labels, notes: list[str]) -> Labels:
    """The labels without a column that only looks like row numbers."""
    if labels.frame is None:
        return labels
    for item in islice(source.episodes([labels.frame], labels.episode), SAMPLE_LOOKED_AT):
        if isinstance(item, Refusal) or len(item.columns[labels.frame]) < 2:
            continue
        if np.median(np.diff(as_float(item.columns[labels.frame]))) == 1.0:
            return labels
        break
    notes.append(f"{labels.frame} does not count rows one by one; it was left aside.")
    return labels.model_copy(update={"frame": None})


def _frozen(channels: Sequence[ChannelSource], commands: Commands, sample: Sample) -> Frozen | None:
    """Only a stream that holds what the action commands must move with it."""
    action, pairing = commands.action, commands.pairing or {}
    paired = set(pairing.values())
    # A change that stays the same is a motion: how far it varies says nothing.
    if any(not commands.forms[name].is_plain for name in pairing):
        return None
    streams = [c.stream for c in channels if paired & {f"{c.name}.{part}" for part in c.components}]
    factors = [SI.get(unit, (unit, 1.0))[1] for unit in action.units]
    low, high = np.quantile(sample.selected(action.columns) * factors, BULK, axis=0)
    spread = float(np.max(high - low))
    if not streams or not (FROZEN_SHARE * spread > 0 and np.isfinite(spread)):
        return None
    motion = float(f"{FROZEN_SHARE * spread:.3g}")
    return Frozen(streams=list(dict.fromkeys(streams)), seconds=FROZEN_S, motion=motion)


def _task(source: Source) -> str:
    return PurePath(source.name).stem or "unnamed"
