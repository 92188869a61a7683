"""One raw episode held against the contract: accepted as frames, or refused with row and reason."""

from typing import Any
from uuid import NAMESPACE_OID, UUID, uuid5

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.assemble import FLAGS, STRATA, AcceptedEpisode, content_hash
from genpolicy.data.checks import check_finite, check_frozen, check_range
from genpolicy.data.contract import IngestContract
from genpolicy.data.formats.contract import SI, ChannelSource, ImportContract, selectors
from genpolicy.data.formats.interventions import FALSE, TRUE, flags_in
from genpolicy.data.formats.source import RawEpisode, as_float, refuse
from genpolicy.data.recording.episode import ACTION_STREAM, NOT_RECORDED, StreamSamples
from genpolicy.data.resample import Rows

Array = NDArray[np.float64]
Times = NDArray[np.int64]

PHASE_ALL = "all"
NS_PER_S = 1_000_000_000
NS = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0}
LARGEST_NS = 2.0**62
MAXIMUM_TEXT = 200
SUCCESS = ("success", "succeeded", "successful", *TRUE)
FAILURE = ("failure", "fail", "failed", *FALSE)
BY_ROW = "is_intervention"
MISSING = ("", "nan", "none", "null", NOT_RECORDED)


def wanted_columns(contract: ImportContract) -> list[str]:
    """Every source column that the contract reads, each once, in a fixed order."""
    texts = [text for channel in contract.channels for text in channel.columns]
    texts += contract.action.columns
    names = [selector.column for selector in selectors(texts, where="contract")]
    return list(dict.fromkeys([*names, *contract.labels.named().values()]))


def accept(raw: RawEpisode, contract: ImportContract) -> AcceptedEpisode:
    """The episode as frames.

    Raises:
        ContractError: It breaks the contract; names column, row and reason.
    """
    label = raw.label
    length = len(next(iter(raw.columns.values()), ()))
    if length < contract.minimum_rows:
        refuse(label, f"{length} rows long", f"at least {contract.minimum_rows}, a demonstration")
    _check_frames(raw, contract)
    sources = {c.name: _numbers(raw, c.columns, f"{label}: {c.name}") for c in contract.channels}
    values = {c.name: _converted(c, sources[c.name]) for c in contract.channels}
    recorded = _numbers(raw, contract.action.columns, f"{label}: action")
    action = recorded * np.array([SI.get(u, (u, 1.0))[1] for u in contract.action.units])
    observation = contract.observation.join(values)
    _check_ranges(observation, action, contract, label)
    ticks = _ticks(raw, contract, length)
    _check_streams(values, action, ticks, contract, label)
    content = content_hash([*sources.values(), recorded])
    return AcceptedEpisode(
        episode_uuid=_uuid(raw, content),
        rows=Rows(
            tick_ns=ticks,
            stream_event_ns=dict.fromkeys(contract.observation.streams, ticks),
            stream_receive_ns=dict.fromkeys(contract.observation.streams, ticks),
            observation=observation,
            action=action,
            phase=_phases(raw, contract, length),
            lead_action=action[:0],
        ),
        strata=_strata(raw, contract),
        flags={name: _flag(raw, contract, name) for name in FLAGS},
        scene_start="",
        source_file=label,
        source_sha256=raw.digest,
        content_sha256=content,
        recorded_at_ns=int(ticks[0]),
        clock_offsets_ns={},
    )


def _check_frames(raw: RawEpisode, contract: ImportContract) -> None:
    """Rows must be numbered without a gap: a missing row is a jump in time that nobody sees."""
    name = contract.labels.frame
    if name is None:
        return
    numbers = _column(raw, name)
    steps = np.diff(as_float(numbers))
    bad = np.flatnonzero(~(steps == 1.0))
    if len(bad):
        row = int(bad[0]) + 1
        expected = "one more than the row before"
        if steps[row - 1] < 0:
            expected += "; where an episode begins there, a column `episode` that says so"
        refuse(
            f"{raw.label}: {name}, row {row}",
            f"{numbers[row]!s} after {numbers[row - 1]!s}",
            expected,
        )


def _numbers(raw: RawEpisode, columns: list[str], where: str) -> Array:
    """The chosen numbers, as recorded, each finite. Shape (n, width)."""
    parts: list[Array] = []
    names: list[str] = []
    for selector in selectors(columns, where="contract"):
        values = _column(raw, selector.column)
        if values.dtype.kind not in "fiub":
            refuse(f"{where}: {selector.column}", f"of type {values.dtype}", "numbers")
        if selector.element is None:
            if values.ndim != 1:
                found = f"{values.shape[1]} numbers wide"
                refuse(f"{where}: {selector.column}", found, "one number; write name[i]")
            parts.append(as_float(values))
            names.append(selector.column)
            continue
        width = values.shape[1] if values.ndim == 2 else 1
        if selector.element >= width:
            found = f"{width} numbers wide"
            refuse(f"{where}: {selector.column}", found, f"an element {selector.element}")
        parts.append(as_float(values.reshape(len(values), -1)[:, selector.element]))
        names.append(f"{selector.column}[{selector.element}]")
    result = np.stack(parts, axis=1)
    check_finite(result, names, where=where)
    return result


def _converted(channel: ChannelSource, values: Array) -> Array:
    si = values * channel.factor
    if channel.transform == "none":
        return si
    return np.stack([np.cos(si), np.sin(si)], axis=2).reshape(len(si), -1)


def _check_ranges(observation: Array, action: Array, contract: ImportContract, label: str) -> None:
    names = list(contract.observation.component_names)
    commanded = [f"action.{component}" for component in contract.action.components]
    for values, columns, part in (
        (observation, names, "observation"),
        (action, commanded, "action"),
    ):
        bounds = np.array([contract.ranges.get(name, (-np.inf, np.inf)) for name in columns])
        check_range(values, columns, bounds[:, 0], bounds[:, 1], f"{label}: {part}")


def _ticks(raw: RawEpisode, contract: ImportContract, length: int) -> Times:
    """When each row was recorded, ns, strictly increasing and without a gap."""
    period_ns = contract.period_s * 1e9
    # The place in the recordings is a time only where the contract says so: else the same
    # episodes in another order would train and test in another way.
    placed = contract.labels.time is None and contract.time_origin == "recording"
    begin = round(raw.first_row * period_ns) + 1 if placed else 1
    name = contract.labels.time
    if name is None:
        return begin + np.round(np.arange(length) * period_ns).astype(np.int64)
    recorded = _column(raw, name)
    if recorded.ndim != 1 or recorded.dtype.kind not in "fiu":
        refuse(f"{raw.label}: {name}", f"of type {recorded.dtype}", "one time per row")
    check_finite(as_float(recorded)[:, None], [name], where=raw.label)
    ticks = _nanoseconds(recorded, contract, f"{raw.label}: {name}")
    ticks = ticks + begin if contract.time_origin == "episode" else ticks
    _check_clock(ticks, f"{raw.label}: {name}", contract.maximum_gap_s)
    return ticks


def _nanoseconds(recorded: NDArray[Any], contract: ImportContract, where: str) -> Times:
    """Recorded times as ns, from the first row of the episode or of the recordings."""
    wild = np.flatnonzero(~(np.abs(as_float(recorded)) * NS[contract.time_unit] < LARGEST_NS))
    if len(wild):
        refuse(f"{where}, row {wild[0]}", str(recorded[wild[0]]), "a time within 146 years")
    # Integers are subtracted as integers: 1.7e18 ns has no exact float.
    times = recorded.astype(np.float64 if recorded.dtype.kind == "f" else np.int64)
    since = times - times[0] if contract.time_origin == "episode" else times
    if since.dtype.kind == "i" and contract.time_unit == "ns":
        return np.asarray(since, dtype=np.int64)
    return np.round(since * NS[contract.time_unit]).astype(np.int64)


def _check_clock(ticks: Times, where: str, maximum_gap_s: float) -> None:
    steps = np.diff(ticks)
    bad = np.flatnonzero(~(steps > 0))
    if len(bad):
        row = int(bad[0]) + 1
        refuse(f"{where}, row {row}", f"{steps[row - 1] / NS_PER_S:.6g} s later", "a rising clock")
    bad = np.flatnonzero(~(steps <= maximum_gap_s * NS_PER_S))
    if len(bad):
        row = int(bad[0]) + 1
        found = f"a gap of {steps[row - 1] / NS_PER_S:.6g} s"
        refuse(f"{where}, row {row}", found, f"at most {maximum_gap_s:.6g} s")
    if ticks[0] < 0:
        refuse(f"{where}, row 0", f"{ticks[0]} ns", "a time from 0 on")


def _check_streams(
    values: dict[str, Array], action: Array, ticks: Times, contract: ImportContract, label: str
) -> None:
    if contract.frozen is None:
        return
    rule = IngestContract(
        contract.observation,
        (PHASE_ALL,),
        frozen_s=contract.frozen.seconds,
        frozen_motion=contract.frozen.motion,
    )
    commanded = StreamSamples(ACTION_STREAM, ticks, ticks, action)
    for stream in contract.frozen.streams:
        parts = [values[c.name] for c in contract.channels if c.stream == stream]
        samples = StreamSamples(stream, ticks, ticks, np.concatenate(parts, axis=1))
        check_frozen(samples, commanded, rule, where=f"{label}: {stream}")


def _phases(raw: RawEpisode, contract: ImportContract, length: int) -> NDArray[np.str_]:
    name = contract.labels.phase
    if name is None:
        return np.full(length, PHASE_ALL)
    if name not in raw.columns:
        return np.full(length, _text(_one(raw, name)))
    names, inverse = np.unique(_column(raw, name), return_inverse=True)
    phases = np.array([_text(value) for value in names])[inverse.reshape(-1)]
    known = contract.phases
    if known is not None and not set(np.unique(phases)) <= set(known):
        row = int(np.argmax(~np.isin(phases, known)))
        refuse(f"{raw.label}: {name}, row {row}", repr(str(phases[row]))[:60], f"one of {known}")
    return np.asarray(phases, dtype=np.str_)


def _strata(raw: RawEpisode, contract: ImportContract) -> dict[str, str]:
    strata = {name: _label(raw, getattr(contract.labels, name)) for name in STRATA}
    if contract.labels.task is None:
        strata["task"] = contract.task
    outcome = strata["outcome"].lower()
    if outcome in SUCCESS:
        strata["outcome"] = "success"
    elif outcome in FAILURE:
        strata["outcome"] = "failure"
    elif outcome != NOT_RECORDED:
        where = f"{raw.label}: {contract.labels.outcome}"
        refuse(where, repr(strata["outcome"])[:60], "success or failure, true or false, 1 or 0")
    return strata


def _flag(raw: RawEpisode, contract: ImportContract, name: str) -> bool | None:
    if not hasattr(contract.labels, name):
        return None
    column = getattr(contract.labels, name)
    if name == BY_ROW:
        # Recorders of both flag each row in which a person acted.
        flags = flags_in(raw, column)
        known = None if flags is None else flags[np.isfinite(flags)]
        if known is not None:
            return bool(known.any()) if len(known) else None
    text = _label(raw, column).lower()
    if text == NOT_RECORDED:
        return None
    if text not in (*TRUE, *FALSE):
        refuse(f"{raw.label}: {name}", repr(text)[:60], "true or false")
    return text in TRUE


def _label(raw: RawEpisode, column: str | None) -> str:
    """The one value of a label in this episode."""
    if column is None:
        return NOT_RECORDED
    text = _text(_one(raw, column))
    return NOT_RECORDED if text.lower() in MISSING else text


def _one(raw: RawEpisode, name: str) -> Any:
    if name not in raw.columns and name in raw.attributes:
        return raw.attributes[name]
    values = _column(raw, name)
    other = np.flatnonzero(values != values[0])
    if len(other) and not _all_missing(values):
        row = int(other[0])
        found = f"{str(values[row])[:40]!r} after {str(values[0])[:40]!r}"
        refuse(f"{raw.label}: {name}, row {row}", found, "one value per episode")
    return values[0]


def _all_missing(values: NDArray[Any]) -> bool:
    return values.dtype.kind == "f" and bool(np.isnan(values).all())


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        value = value.decode("utf-8", errors="replace")
    if isinstance(value, float | np.floating) and float(value).is_integer():
        value = int(value)
    return "" if value is None else str(value)[:MAXIMUM_TEXT]


def _column(raw: RawEpisode, name: str) -> NDArray[Any]:
    if name not in raw.columns:
        known = sorted({*raw.columns, *raw.attributes})
        refuse(
            f"{raw.label}: column {name}",
            "missing",
            f"one of {known[:12]}",
            "Correct the contract, or let `genpolicy propose` write a new one.",
        )
    return raw.columns[name]


def _uuid(raw: RawEpisode, content: str) -> str:
    """The recorded UUID, or one that follows from the samples."""
    recorded = raw.attributes.get("episode_uuid")
    if recorded is None:
        return str(uuid5(NAMESPACE_OID, content))
    try:
        valid = str(UUID(recorded)) == recorded
    except ValueError:
        valid = False
    if not valid:
        refuse(f"{raw.label}: episode_uuid", repr(recorded)[:60], "a lower-case UUID")
    return recorded
