"""MCAP recordings in this project's layout: the contract of their task, or one of their streams.

Reading, checking and resampling are `genpolicy.data.ingest`'s; here is only which contract.
"""

from collections.abc import Sequence
from hashlib import sha256
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from genpolicy.contract.observation import ObservationContract
from genpolicy.data.assemble import REFUSALS_FILE, Refusal
from genpolicy.data.contract import TCP_ACTION, IngestContract, SplitRule, plausible_ranges
from genpolicy.data.formats.contract import (
    ActionSource,
    ChannelSource,
    Frozen,
    ImportContract,
    Labels,
    contract_of,
    selectors,
)
from genpolicy.data.formats.detect import files_of
from genpolicy.data.formats.open_questions import open_questions
from genpolicy.data.formats.pairing import pair_by_name
from genpolicy.data.formats.result import Opened
from genpolicy.data.ingest import ingest_recordings
from genpolicy.data.recording.episode import (
    ACTION_STREAM,
    CAMERA_STREAM,
    FORCE_STREAM,
    JOINTS_STREAM,
    PHASE_STREAM,
    ROBOT_STREAM,
    RecordedEpisode,
)
from genpolicy.data.recording.reader import read_episode
from genpolicy.errors import BadInputError, ConfigError
from genpolicy.integrity.documents import read_json
from genpolicy.robot.limits import LIMITS
from genpolicy.tasks.api import ENTRY_POINT_GROUP, Task, load_task

LOOKED_AT = 5
HEAD_BYTES = 1 << 16
MAXIMUM_AGE_S = 0.3
FROZEN = {"seconds": 0.5, "motion": 0.01}
# Metadata that every recording carries; see genpolicy.data.recording.episode.REQUIRED_METADATA.
LABELS = Labels(
    phase="phase",
    task="task",
    object="object",
    operator="operator",
    calibration_epoch="calibration_epoch",
    outcome="outcome",
    is_recovery="is_recovery",
    is_intervention="is_intervention",
)
# Channels of the streams whose topics the recording layout defines: name, components, unit.
KNOWN: dict[str, tuple[tuple[str, tuple[str, ...], str], ...]] = {
    ROBOT_STREAM: (
        ("tcp_position_m", ("x", "y", "z"), "m"),
        ("tcp_rotation", tuple(f"column_{c}_{a}" for c in (0, 1) for a in "xyz"), "1"),
        ("gripper_opening_m", ("opening",), "m"),
    ),
    FORCE_STREAM: (("wrench_n", ("x", "y", "z"), "N"),),
    CAMERA_STREAM: (
        ("target_pose", ("x_m", "y_m", "cos_yaw", "sin_yaw"), "1"),
        ("obstacle_position_m", ("y",), "m"),
    ),
}


def recordings(path: Path) -> list[Path]:
    """The MCAP files at `path`, by name.

    Raises:
        BadInputError: There is none.
    """
    files = files_of(path, "mcap")
    if not files:
        raise BadInputError(
            where=str(path),
            found="without an .mcap file",
            expected="a folder of recordings",
            action="Check the path.",
        )
    return files


def propose_recordings(path: Path, *, task: str | None) -> ImportContract:
    """The contract of the registered task that was recorded, else one of the recorded streams.

    Raises:
        BadInputError: No readable recording, or `task` is not registered.
    """
    episodes = _readable(recordings(path))
    registered = {point.name for point in entry_points(group=ENTRY_POINT_GROUP)}
    name = task or episodes[0].metadata.get("task", "unnamed")
    if task is not None or name in registered:
        found = load_task(name)
        if task is not None or _fits(found.observation, episodes[0]):
            return _task_contract(found, episodes[0])
    return _stream_contract(episodes, name)


def import_recordings(
    path: Path, *, contract: ImportContract, out: Path, split: SplitRule | None
) -> Opened:
    """Hold every recording against the contract and write the dataset.

    Raises:
        BadInputError: The contract cannot be applied to MCAP, or too few were accepted.
    """
    notes = tuple(dict.fromkeys([*contract.notes, *open_questions(contract)]))
    ingest_recordings(
        recordings(path),
        contract=ingest_contract(contract),
        out=out,
        split=split,
        notes=notes,
        import_contract=contract.model_dump(mode="json"),
    )
    counts = read_json(out / REFUSALS_FILE)
    refused = tuple(Refusal(**item) for item in counts["refused"])
    return Opened(out, contract, counts["found"], counts["accepted"], refused, notes)


def ingest_contract(contract: ImportContract) -> IngestContract:
    """The same rules in the words of the ingest of recordings.

    Raises:
        ConfigError: It reads a part of a stream, or converts: recordings are whole and in SI.
    """
    _check_whole(contract)
    frozen = contract.frozen
    joints = contract.joint_range_rad
    return IngestContract(
        observation=contract.observation,
        phases=tuple(contract.phases or ()),
        action=contract.action_contract,
        action_period_s=contract.period_s,
        ranges={name: (low, high) for name, (low, high) in contract.ranges.items()},
        joint_range_rad=None if joints is None else (tuple(joints[0]), tuple(joints[1])),
        motion_streams=() if frozen is None else tuple(frozen.streams),
        maximum_gap_s=contract.maximum_gap_s,
        minimum_rows=contract.minimum_rows,
        frozen_s=IngestContract.frozen_s if frozen is None else frozen.seconds,
        frozen_motion=IngestContract.frozen_motion if frozen is None else frozen.motion,
    )


def _check_whole(contract: ImportContract) -> None:
    read: dict[str, list[int | None]] = {}
    for channel in contract.channels:
        place = f"contract: channels ({channel.name})"
        if channel.transform != "none" or channel.factor != 1.0:
            _refuse(place, "converted", "SI units as recorded; MCAP recordings are in SI")
        for selector in selectors(channel.columns, where=place):
            if selector.column != channel.stream:
                _refuse(place, f"of {selector.column}", f"of its own stream, {channel.stream}")
            read.setdefault(channel.stream, []).append(selector.element)
    for stream, elements in read.items():
        if elements != list(range(len(elements))):
            _refuse(f"contract: stream {stream}", f"read as {elements}"[:80], "whole, in its order")


def _readable(files: Sequence[Path]) -> list[RecordedEpisode]:
    episodes: list[RecordedEpisode] = []
    first: BadInputError | None = None
    for path in sorted(files, key=_head):
        try:
            episodes.append(read_episode(path))
        except BadInputError as error:
            first = first or error
        if len(episodes) == LOOKED_AT:
            break
    usable = [e for e in episodes if ACTION_STREAM in e.streams and len(e.streams) > 1]
    if usable:
        return usable
    if first is not None and not episodes:
        raise first
    _refuse(str(files[0]), "without an action stream and a sensor", "a recorded demonstration")


def _head(path: Path) -> tuple[str, str]:
    """What orders recordings whatever they are called: the bytes that they begin with."""
    try:
        with path.open("rb") as stream:
            return sha256(stream.read(HEAD_BYTES)).hexdigest(), path.name
    except OSError:
        return "", path.name


def _fits(observation: ObservationContract, episode: RecordedEpisode) -> bool:
    widths: dict[str, int] = {}
    for channel in observation.channels:
        widths[channel.stream] = widths.get(channel.stream, 0) + channel.size
    widths.pop(PHASE_STREAM, None)
    return all(
        name in episode.streams and episode.streams[name].values.shape[1] == width
        for name, width in widths.items()
    )


def _period_s(episodes: Sequence[RecordedEpisode]) -> float:
    steps = np.concatenate([np.diff(e.streams[ACTION_STREAM].event_time_ns) for e in episodes])
    steps = steps[steps > 0]
    if not len(steps):
        _refuse("the first recordings", "without two actions", "a rate")
    return float(f"{float(np.median(steps)) / 1e9:.4g}")


def _task_contract(task: Task, episode: RecordedEpisode) -> ImportContract:
    ranges = plausible_ranges(
        task.observation,
        TCP_ACTION,
        workspace_lower_m=np.array(task.workspace.lower_m),
        workspace_upper_m=np.array(task.workspace.upper_m),
    )
    offsets: dict[str, int] = {}
    channels = []
    for channel in task.observation.channels:
        start = offsets.get(channel.stream, 0)
        offsets[channel.stream] = start + channel.size
        channels.append(
            ChannelSource(
                name=channel.name,
                columns=[f"{channel.stream}[{start}:{start + channel.size}]"],
                components=list(channel.components),
                unit=channel.unit,
                stream=channel.stream,
                maximum_age_s=channel.maximum_age_s,
            )
        )
    recorded = episode.metadata.get("robot", "").lower()
    tables = {**LIMITS, task.limits.robot: task.limits}
    limits = next((table for name, table in tables.items() if name in recorded), None)
    contract = _contract(
        task.name, channels, tuple(task.phases), _period_s([episode]), _tcp_action()
    )
    update: dict[str, object] = {
        "ranges": {name: [low, high] for name, (low, high) in ranges.items()},
        "audit": contract.audit | _audit_of(task),
    }
    if limits is not None:
        update["joint_range_rad"] = [
            limits.position_lower_rad.tolist(),
            limits.position_upper_rad.tolist(),
        ]
    return contract_of(contract.model_copy(update=update).model_dump(), where="the task's contract")


def _audit_of(task: Task) -> dict[str, Any]:
    """What the audit holds modes against, as the task names it."""
    channels = task.audit_channels
    return {
        "position_channel": channels.position,
        "position_components": None,
        "action_components": None,
        "reference_channel": channels.reference,
        "calibration_phase": channels.calibration_phase,
        "context_channels": list(channels.context),
    }


def _stream_contract(episodes: Sequence[RecordedEpisode], task: str) -> ImportContract:
    channels: list[ChannelSource] = []
    first = episodes[0]
    for stream in sorted(set(first.streams) - {ACTION_STREAM}):
        width = first.streams[stream].values.shape[1]
        known = KNOWN.get(stream, ())
        if sum(len(components) for _, components, _ in known) != width:
            unit = "rad" if stream == JOINTS_STREAM else "unknown"
            known = ((stream, tuple(f"{stream}_{i}" for i in range(width)), unit),)
        start = 0
        for name, components, unit in known:
            stop = start + len(components)
            channels.append(
                ChannelSource(
                    name=name,
                    columns=[f"{stream}[{start}:{stop}]"],
                    components=list(components),
                    unit=unit,
                    stream=stream,
                    maximum_age_s=MAXIMUM_AGE_S,
                )
            )
            start = stop
    width = first.streams[ACTION_STREAM].values.shape[1]
    action = _tcp_action() if width == TCP_ACTION.dim else _plain_action(width)
    phases = tuple(dict.fromkeys(p for e in episodes for _, _, p in e.phase_events))
    return _contract(task, channels, phases, _period_s(episodes), action)


def _contract(
    task: str,
    channels: list[ChannelSource],
    phases: tuple[str, ...],
    period_s: float,
    action: ActionSource,
) -> ImportContract:
    streams = {channel.stream for channel in channels}
    moving = sorted(streams & {ROBOT_STREAM, JOINTS_STREAM})
    audit: dict[str, Any] = {}
    if PHASE_STREAM in streams:
        audit = {"phase_observed": True, "ignored_channels": ["phase"]}
    values = ImportContract(
        format="mcap",
        task=task,
        rate_hz=1.0 / period_s,
        channels=channels,
        action=action,
        pairing=pair_by_name(channels, action),
        labels=LABELS,
        time_unit="ns",
        time_origin="recording",
        phases=list(phases),
        minimum_rows=4,
        maximum_gap_s=0.25,
        frozen=Frozen(streams=moving, **FROZEN) if moving else None,
        audit=audit,
    )
    return contract_of(values.model_dump(), where="the proposed contract")


def _tcp_action() -> ActionSource:
    return ActionSource(
        columns=[f"{ACTION_STREAM}[0:{TCP_ACTION.dim}]"],
        components=list(TCP_ACTION.components),
        units=list(TCP_ACTION.units),
        frame=TCP_ACTION.frame,
    )


def _plain_action(width: int) -> ActionSource:
    return ActionSource(
        columns=[f"{ACTION_STREAM}[0:{width}]"],
        components=[f"action_{i}" for i in range(width)],
        units=["unknown"] * width,
        guessed=True,
    )


def _refuse(where: str, found: str, expected: str) -> NoReturn:
    raise ConfigError(
        where=where, found=found, expected=expected, action="Correct the contract or the path."
    )
