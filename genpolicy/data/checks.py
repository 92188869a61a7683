"""Is this recording what the contract says? Each check refuses with the stream, row and column.

Event times are those of the recording after its declared clock offset has been removed.
"""

import json
from collections.abc import Sequence
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.contract import IngestContract
from genpolicy.data.recording.episode import (
    ACTION_STREAM,
    JOINTS_STREAM,
    OUTCOMES,
    PHASE_STREAM,
    REQUIRED_METADATA,
    RecordedEpisode,
    StreamSamples,
    clock_offset_key,
)
from genpolicy.errors import ContractError, NonFiniteError

Array = NDArray[np.float64]

NS_PER_S = 1e9
PERIOD_TOLERANCE = 0.25
ACTION = "Correct the recorder, or leave this recording out."


def sensor_streams(contract: IngestContract) -> tuple[str, ...]:
    """Streams of samples that the observation needs, the phase events aside."""
    return tuple(name for name in contract.observation.streams if name != PHASE_STREAM)


def check_recording(episode: RecordedEpisode, contract: IngestContract, *, where: str) -> None:
    """Every check on one recording whose clock offsets have been removed.

    Raises:
        ContractError: The first broken rule, by stream, row and column.
    """
    check_metadata(episode, contract, where=where)
    needed = (*sensor_streams(contract), ACTION_STREAM)
    present = (*needed, *((JOINTS_STREAM,) if JOINTS_STREAM in episode.streams else ()))
    for name in present:
        place = f"{where}: stream {name}"
        samples = episode.streams.get(name)
        if samples is None or len(samples) < 2:
            _refuse(place, "missing or of fewer than 2 samples", "recorded during the episode")
        if name == ACTION_STREAM and len(samples) < contract.minimum_rows:
            _refuse(place, f"{len(samples)} rows long", f"at least {contract.minimum_rows}")
        names = component_names(contract, name, samples.values.shape[1])
        if samples.values.shape[1] != len(names):
            _refuse(place, f"{samples.values.shape[1]} numbers wide", f"{len(names)}: {names}")
        check_finite(samples.values, names, where=place)
        _check_clock(samples, contract, place)
        _check_range(samples.values, names, contract, place)
    _check_phases(episode, contract, where)
    action = episode.streams[ACTION_STREAM]
    for name in present:
        if name in contract.motion_streams:
            check_frozen(episode.streams[name], action, contract, where=f"{where}: stream {name}")


def check_metadata(episode: RecordedEpisode, contract: IngestContract, *, where: str) -> None:
    """The strata and the declared clock offsets must be there and readable.

    Raises:
        ContractError: A key is missing or its value is not one of the known ones.
    """
    for key in REQUIRED_METADATA:
        if not episode.metadata.get(key):
            _refuse(f"{where}: metadata {key}", "missing or empty", "recorded with the episode")
    if episode.metadata["outcome"] not in OUTCOMES:
        found = episode.metadata["outcome"][:40]
        _refuse(f"{where}: metadata outcome", repr(found), f"one of {OUTCOMES}")
    for key in ("is_recovery", "is_intervention"):
        if episode.metadata[key].lower() not in ("true", "false"):
            found = episode.metadata[key][:40]
            _refuse(f"{where}: metadata {key}", repr(found), "true or false")
    try:
        json.loads(episode.metadata["scene_start"])
    except (ValueError, RecursionError):
        _refuse(f"{where}: metadata scene_start", "not JSON", "the start of the scene as JSON")
    for name in (*sensor_streams(contract), ACTION_STREAM):
        clock_offset_ns(episode, name, where=where)


def clock_offset_ns(episode: RecordedEpisode, stream: str, *, where: str) -> int:
    """Declared clock offset of a stream, ns; 0 for phase events that declare none.

    Raises:
        ContractError: Missing, or not an integer.
    """
    key = clock_offset_key(stream)
    text = episode.metadata.get(key, "0" if stream == PHASE_STREAM else "")
    try:
        return int(text)
    except ValueError:
        _refuse(f"{where}: metadata {key}", repr(text)[:40], "an integer number of ns")


def component_names(contract: IngestContract, stream: str, width: int) -> list[str]:
    """`channel.component` of every number of a stream's samples."""
    if stream == ACTION_STREAM:
        return [f"action.{component}" for component in contract.action.components]
    if stream == JOINTS_STREAM:
        expected = width if contract.joint_range_rad is None else len(contract.joint_range_rad[0])
        return [f"joint_{index + 1}_rad" for index in range(expected)]
    return [
        f"{channel.name}.{component}"
        for channel in contract.observation.channels
        if channel.stream == stream
        for component in channel.components
    ]


def check_finite(values: Array, names: Sequence[str], *, where: str) -> None:
    """Raises NonFiniteError with row and column of the first number that is not finite."""
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        row, column = bad[0]
        raise NonFiniteError(
            where=f"{where}, row {row}, column {names[column]}",
            found=str(values[row, column]),
            expected="a finite number",
            action=ACTION,
        )


def check_range(values: Array, names: Sequence[str], low: Array, high: Array, where: str) -> None:
    """Raises ContractError with row and column of the first number outside its range."""
    bad = np.argwhere(~((values >= low) & (values <= high)))
    if len(bad):
        row, column = bad[0]
        raise ContractError(
            where=f"{where}, row {row}, column {names[column]}",
            found=f"{values[row, column]:.6g}",
            expected=f"{low[column]:.6g} to {high[column]:.6g}",
            action="Check the unit (m not mm, rad not degrees) and the frame of the recorder.",
        )


def check_frozen(
    samples: StreamSamples, action: StreamSamples, contract: IngestContract, *, where: str
) -> None:
    """A sensor that repeats one sample bit for bit, while the action moves, is frozen.

    Raises:
        ContractError: Names the first row of the constant run.
    """
    changed = np.flatnonzero(np.any(np.diff(samples.values, axis=0) != 0, axis=1)) + 1
    starts = np.concatenate([[0], changed])
    ends = np.concatenate([changed, [len(samples)]]) - 1
    times = samples.event_time_ns
    for start, end in zip(starts, ends, strict=True):
        if times[end] - times[start] < contract.frozen_s * NS_PER_S:
            continue
        inside = (action.event_time_ns >= times[start]) & (action.event_time_ns <= times[end])
        moved = np.ptp(action.values[inside], axis=0).max() if inside.any() else 0.0
        if moved > contract.frozen_motion:
            _refuse(
                f"{where}, row {start}",
                f"constant for {(times[end] - times[start]) / NS_PER_S:.3f} s while the action "
                f"moves by {moved:.3g}",
                f"a changing reading within {contract.frozen_s} s",
            )


def _check_clock(samples: StreamSamples, contract: IngestContract, where: str) -> None:
    step = np.diff(samples.event_time_ns)
    if (step <= 0).any():
        row = int(np.argmax(step <= 0)) + 1
        _refuse(
            f"{where}, row {row}: event time", f"{step[row - 1]} ns later", "an advancing clock"
        )
    delay = samples.receive_time_ns - samples.event_time_ns
    early = delay < -contract.clock_tolerance_s * NS_PER_S
    if early.any():
        row = int(np.argmax(early))
        _refuse(
            f"{where}, row {row}: receive time",
            f"{-delay[row] / NS_PER_S:.6f} s before its event time",
            f"at most {contract.clock_tolerance_s} s before (a negative age)",
        )
    gap_s = contract.maximum_gap_s
    if samples.stream == ACTION_STREAM:
        gap_s = (1.0 + PERIOD_TOLERANCE) * contract.action_period_s
        short = step < (1.0 - PERIOD_TOLERANCE) * contract.action_period_s * NS_PER_S
        if short.any():
            row = int(np.argmax(short)) + 1
            _refuse(
                f"{where}, row {row}: event time",
                f"{step[row - 1] / NS_PER_S:.6f} s later",
                f"one action period, {contract.action_period_s} s",
            )
    if (step > gap_s * NS_PER_S).any():
        row = int(np.argmax(step > gap_s * NS_PER_S)) + 1
        _refuse(
            f"{where}, row {row}: event time",
            f"a gap of {step[row - 1] / NS_PER_S:.6f} s",
            f"at most {gap_s:.6g} s",
        )


def _check_range(values: Array, names: Sequence[str], contract: IngestContract, where: str) -> None:
    if where.endswith(f"stream {JOINTS_STREAM}"):
        if contract.joint_range_rad is not None:
            low, high = (np.array(side) for side in contract.joint_range_rad)
            check_range(values, names, low, high, where)
        return
    bounds = [contract.ranges.get(name, (-np.inf, np.inf)) for name in names]
    check_range(
        values, names, np.array([b[0] for b in bounds]), np.array([b[1] for b in bounds]), where
    )


def _check_phases(episode: RecordedEpisode, contract: IngestContract, where: str) -> None:
    place = f"{where}: phase"
    if not episode.phase_events:
        _refuse(place, "without events", "at least the phase in which the episode begins")
    for row, (event, receive, phase) in enumerate(episode.phase_events):
        if phase not in contract.phases:
            _refuse(f"{place}, row {row}", repr(phase)[:60], f"one of {contract.phases}")
        if row and event <= episode.phase_events[row - 1][0]:
            _refuse(f"{place}, row {row}: event time", "not later", "an advancing clock")
        if receive < event - contract.clock_tolerance_s * NS_PER_S:
            _refuse(f"{place}, row {row}: receive time", "before its event time", "at or after it")


def _refuse(where: str, found: str, expected: str) -> NoReturn:
    raise ContractError(where=where, found=found, expected=expected, action=ACTION)
