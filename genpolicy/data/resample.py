"""From streams to frames: one row per action, with what was known at that instant.

Causal zero-order hold: a row uses the newest sample of each stream that had been exposed *and*
received when the action was commanded. Nothing is interpolated, nothing comes from the future.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.checks import clock_offset_ns, sensor_streams
from genpolicy.data.contract import IngestContract
from genpolicy.data.recording.episode import ACTION_STREAM, PHASE_STREAM, RecordedEpisode
from genpolicy.errors import ContractError

Array = NDArray[np.float64]
Times = NDArray[np.int64]

NS_PER_S = 1e9


@dataclass(frozen=True)
class Rows:
    """The frames of one episode.

    Attributes:
        tick_ns: When each action was commanded, host clock, ns. Shape (n,).
        stream_event_ns: Event time of the sample used, by stream, ns. Shape (n,) each.
        stream_receive_ns: Its receive time, ns. Shape (n,) each.
        observation: Shape (n, D_o).
        action: Shape (n, D_a).
        phase: Phase names. Shape (n,).
        lead_action: Actions before the first complete observation; they are no frames, but a
            replay needs them. Shape (lead, D_a).
    """

    tick_ns: Times
    stream_event_ns: dict[str, Times]
    stream_receive_ns: dict[str, Times]
    observation: Array
    action: Array
    phase: NDArray[np.str_]
    lead_action: Array


def remove_clock_offsets(episode: RecordedEpisode, *, where: str) -> RecordedEpisode:
    """The episode with every event time on the host's clock: event time minus declared offset.

    Raises:
        ContractError: An offset is missing, not an integer, or moves a time out of range.
    """
    streams = {}
    for name, samples in episode.streams.items():
        offset = clock_offset_ns(episode, name, where=where)
        _check_shift(samples.event_time_ns.tolist(), offset, f"{where}: stream {name}")
        streams[name] = replace(samples, event_time_ns=samples.event_time_ns - offset)
    offset = clock_offset_ns(episode, PHASE_STREAM, where=where)
    _check_shift([event for event, _, _ in episode.phase_events], offset, f"{where}: phase")
    events = tuple((event - offset, receive, p) for event, receive, p in episode.phase_events)
    return replace(episode, streams=streams, phase_events=events)


def hold(tick_ns: Times, event_ns: Times, receive_ns: Times) -> NDArray[np.intp]:
    """Newest sample that was exposed and received at each tick; -1 where there is none.

    Args:
        tick_ns: Ticks, ns. Shape (n,).
        event_ns: Event times, strictly increasing, ns. Shape (m,).
        receive_ns: Receive times in the same order, which may overtake each other. Shape (m,).

    Returns:
        Index into the samples. Shape (n,).
    """
    known_ns = np.maximum(event_ns, receive_ns)
    order = np.argsort(known_ns, kind="stable")
    newest = np.maximum.accumulate(order)
    count = np.searchsorted(known_ns[order], tick_ns, side="right")
    return np.where(count > 0, newest[np.maximum(count - 1, 0)], -1)


def resample(episode: RecordedEpisode, contract: IngestContract, *, where: str) -> Rows:
    """Frames of an episode that passed the contract checks, on one clock.

    Raises:
        ContractError: A channel is older than its maximum age at a tick, or no observation is
            complete within `maximum_lead_s`.
    """
    action = episode.streams[ACTION_STREAM]
    ticks = action.event_time_ns
    streams = sensor_streams(contract)
    picks: dict[str, NDArray[np.intp]] = {}
    times: dict[str, tuple[Times, Times]] = {}
    for name in streams:
        samples = episode.streams[name]
        times[name] = (samples.event_time_ns, samples.receive_time_ns)
    events = np.array([event for event, _, _ in episode.phase_events], dtype=np.int64)
    received = np.array([receive for _, receive, _ in episode.phase_events], dtype=np.int64)
    times[PHASE_STREAM] = (events, received)
    for name, (event_ns, receive_ns) in times.items():
        picks[name] = hold(ticks, event_ns, receive_ns)
    lead = _lead_rows(picks, ticks, contract, where)
    picks = {name: pick[lead:] for name, pick in picks.items()}
    ticks = ticks[lead:]
    _check_ages(ticks, picks, times, contract, where)
    names = np.array([phase for _, _, phase in episode.phase_events])
    return Rows(
        tick_ns=ticks,
        stream_event_ns={name: times[name][0][pick] for name, pick in picks.items()},
        stream_receive_ns={name: times[name][1][pick] for name, pick in picks.items()},
        observation=_observe(episode, contract, picks, names),
        action=action.values[lead:],
        phase=names[picks[PHASE_STREAM]],
        lead_action=action.values[:lead],
    )


def _check_shift(event_ns: list[int], offset_ns: int, where: str) -> None:
    """Raises ContractError where an offset moves a time out of 1 to 2**63 - 1 ns."""
    if event_ns and not 0 < min(event_ns) - offset_ns <= max(event_ns) - offset_ns < 1 << 63:
        raise ContractError(
            where=f"{where}: declared clock offset",
            found=f"{offset_ns} ns",
            expected="one that leaves every event time between 1 and 2**63 - 1 ns",
            action="Declare the sensor's clock minus the host's clock, in ns.",
        )


def _lead_rows(
    picks: dict[str, NDArray[np.intp]], ticks: Times, contract: IngestContract, where: str
) -> int:
    complete = np.all([pick >= 0 for pick in picks.values()], axis=0)
    lead = int(np.argmax(complete)) if complete.any() else len(ticks)
    if lead == len(ticks) or ticks[lead] - ticks[0] > contract.maximum_lead_s * NS_PER_S:
        missing = [name for name, pick in picks.items() if pick[min(lead, len(ticks)) - 1] < 0]
        raise ContractError(
            where=f"{where}: start of the episode",
            found=f"{lead} actions without a sample of {missing}",
            expected=f"every stream within {contract.maximum_lead_s} s of the first action",
            action="Start the sensors before the first action.",
        )
    return lead


def _check_ages(
    ticks: Times,
    picks: dict[str, NDArray[np.intp]],
    times: dict[str, tuple[Times, Times]],
    contract: IngestContract,
    where: str,
) -> None:
    """Phase events are exempt: a phase lasts until the next one, it does not grow old."""
    for channel in contract.observation.channels:
        if channel.stream == PHASE_STREAM:
            continue
        age_s = (ticks - times[channel.stream][0][picks[channel.stream]]) / NS_PER_S
        margin = channel.maximum_age_s - age_s
        bad = np.flatnonzero(~(margin >= 0))
        if len(bad):
            raise ContractError(
                where=f"{where}: channel {channel.name} at action {bad[0]} of the frames",
                found=f"{age_s[bad[0]]:.6f} s old",
                expected=f"at most {channel.maximum_age_s} s",
                action="Check the sensor's rate and delay, or leave this recording out.",
            )


def _observe(
    episode: RecordedEpisode,
    contract: IngestContract,
    picks: dict[str, NDArray[np.intp]],
    phase_names: NDArray[np.str_],
) -> Array:
    offsets = dict.fromkeys(contract.observation.streams, 0)
    values: dict[str, Array] = {}
    for channel in contract.observation.channels:
        pick = picks[channel.stream]
        if channel.stream == PHASE_STREAM:
            current = phase_names[pick]
            values[channel.name] = (current[:, None] == np.array(contract.phases)).astype(float)
            continue
        start = offsets[channel.stream]
        offsets[channel.stream] = start + channel.size
        samples = episode.streams[channel.stream].values
        values[channel.name] = samples[pick, start : start + channel.size]
    return contract.observation.join(values)
