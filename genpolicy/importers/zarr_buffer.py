"""A zarr v2 replay buffer (the layout published with Diffusion Policy) to a dataset.

The buffer knows rows and episode ends and nothing else: no clock, no outcome, no operator, no
epoch. They are declared `not_recorded` and never guessed. zarr fills missing chunks with zeros
and can name codecs that unpickle; both are refused before anything is decoded.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn
from uuid import NAMESPACE_OID, uuid5

import numpy as np
import zarr
from numpy.typing import NDArray

from genpolicy.contract.observation import Channel, ObservationContract
from genpolicy.dataset.assemble import (
    FLAGS,
    STRATA,
    AcceptedEpisode,
    Description,
    Refusal,
    content_hash,
    write_dataset,
)
from genpolicy.dataset.checks import check_finite, check_frozen, check_range
from genpolicy.dataset.contract import ActionContract, IngestContract, SplitRule
from genpolicy.dataset.resample import Rows
from genpolicy.errors import BadInputError, ContractError, IntegrityError
from genpolicy.integrity.documents import canonical_json, read_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_tree
from genpolicy.recording.episode import ACTION_STREAM, NOT_RECORDED, StreamSamples

Array = NDArray[np.float64]

MAXIMUM_ARRAY_BYTES = 1 << 30
NUMERIC_TYPES = ("<f4", "<f8", "<i4", "<i8")
COMPRESSORS = ("blosc", "zstd", "zlib", "lz4")
PHASE_ALL = "all"
CLOCK_NOTE = (
    "no clock was recorded: event and receive time are row / rate, recording time is the order "
    "of the episodes in the buffer"
)
ACTION = "Fetch the buffer again, or leave this episode out."


@dataclass(frozen=True)
class ReplayBufferContract:
    """How the arrays of a buffer become observations and actions.

    Attributes:
        task: Name of the task.
        observation: Channels of the observation, all of one stream.
        action: The action.
        state_width: Width of `data/state`.
        observe: `data/state` rows (n, state_width) to observations (n, D_o).
        action_period_s: Time between rows, s.
        ranges: Plausible values by `channel.component` and `action.component`.
        frozen_s: A state bit-constant for this long, while the action moves, is frozen.
        frozen_motion: How far the action must move for that, in its unit.
    """

    task: str
    observation: ObservationContract
    action: ActionContract
    state_width: int
    observe: Callable[[Array], Array]
    action_period_s: float
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    frozen_s: float = 2.0
    frozen_motion: float = 64.0


def _observe_pusht(state: Array) -> Array:
    """Agent and block position, px; the block's angle as cosine and sine, free of its jump."""
    angle = state[:, 4:5]
    return np.concatenate([state[:, :4], np.cos(angle), np.sin(angle)], axis=1)


_BOARD_PX = (-64.0, 576.0)
PUSHT = ReplayBufferContract(
    task="pusht",
    observation=ObservationContract(
        (
            Channel("agent_position_px", ("x", "y"), "px", "state", 0.1),
            Channel("block_position_px", ("x", "y"), "px", "state", 0.1),
            Channel("block_angle", ("cos", "sin"), "1", "state", 0.1),
        )
    ),
    action=ActionContract("board", ("agent_x_px", "agent_y_px"), ("px", "px")),
    state_width=5,
    observe=_observe_pusht,
    action_period_s=0.1,
    ranges={
        "agent_position_px.x": _BOARD_PX,
        "agent_position_px.y": _BOARD_PX,
        "block_position_px.x": _BOARD_PX,
        "block_position_px.y": _BOARD_PX,
        "action.agent_x_px": _BOARD_PX,
        "action.agent_y_px": _BOARD_PX,
    },
)


def ingest_zarr_replay_buffer(
    path: Path,
    *,
    out: Path,
    contract: ReplayBufferContract = PUSHT,
    split: SplitRule | None = None,
) -> None:
    """Read a replay buffer, hold each episode against the contract, write the dataset folder.

    Args:
        path: The `.zarr` folder with `data/state`, `data/action` and `meta/episode_ends`.
        out: The dataset folder; whole or not at all, an old one is replaced.
        contract: How its arrays become observations and actions.
        split: Shares of the splits, in the order of the buffer; 70 / 15 / 15 if absent.

    Raises:
        BadInputError: Not such a buffer, a chunk is missing, or too few episodes were accepted.
    """
    digest = sha256_bytes(canonical_json(sha256_tree(path)))
    state = _array(path / "data" / "state").astype(np.float64)
    action = _array(path / "data" / "action").astype(np.float64)
    ends = _array(path / "meta" / "episode_ends")
    _check_shapes(path, state, action, ends, contract)
    accepted: list[AcceptedEpisode] = []
    refused: list[Refusal] = []
    seen: dict[str, str] = {}
    for number, end in enumerate(ends.tolist()):
        start = int(ends[number - 1]) if number else 0
        label = f"{path.name}#episode_{number:06d}"
        try:
            episode = _accept(
                state[start:end],
                action[start:end],
                start=start,
                label=label,
                digest=digest,
                contract=contract,
            )
            if episode.content_sha256 in seen:
                _refuse(label, f"the samples of {seen[episode.content_sha256]} again", "once")
            seen[episode.content_sha256] = label
            accepted.append(episode)
        except BadInputError as error:
            refused.append(Refusal(file=label, where=error.where, reason=str(error)))
    write_dataset(
        out,
        accepted=accepted,
        refused=refused,
        found=len(ends),
        description=Description(
            source_kind="zarr_replay_buffer",
            observation=contract.observation,
            action=contract.action,
            phases=(PHASE_ALL,),
            action_period_s=contract.action_period_s,
            split=split or SplitRule(),
            clock_note=CLOCK_NOTE,
        ),
    )


def _accept(
    state: Array,
    action: Array,
    *,
    start: int,
    label: str,
    digest: str,
    contract: ReplayBufferContract,
) -> AcceptedEpisode:
    if len(state) < 2:
        _refuse(label, f"{len(state)} rows long", "at least 2")
    stream = contract.observation.streams[0]
    names = list(contract.observation.component_names)
    action_names = [f"action.{component}" for component in contract.action.components]
    check_finite(state, [f"state[{i}]" for i in range(state.shape[1])], where=f"{label}: state")
    observation = contract.observe(state)
    for values, columns, place in (
        (observation, names, f"{label}: {stream}"),
        (action, action_names, f"{label}: action"),
    ):
        check_finite(values, columns, where=place)
        bounds = np.array([contract.ranges.get(c, (-np.inf, np.inf)) for c in columns])
        check_range(values, columns, bounds[:, 0], bounds[:, 1], place)
    period_ns = round(contract.action_period_s * 1e9)
    tick_ns = (start + np.arange(len(state), dtype=np.int64)) * period_ns + 1
    check_frozen(
        StreamSamples(stream, tick_ns, tick_ns, state),
        StreamSamples(ACTION_STREAM, tick_ns, tick_ns, action),
        IngestContract(
            contract.observation,
            (PHASE_ALL,),
            frozen_s=contract.frozen_s,
            frozen_motion=contract.frozen_motion,
        ),
        where=f"{label}: {stream}",
    )
    content = content_hash([state, action])
    return AcceptedEpisode(
        episode_uuid=str(uuid5(NAMESPACE_OID, content)),
        rows=Rows(
            tick_ns=tick_ns,
            stream_event_ns={stream: tick_ns},
            stream_receive_ns={stream: tick_ns},
            observation=observation,
            action=action,
            phase=np.full(len(state), PHASE_ALL),
            lead_action=action[:0],
        ),
        strata={name: NOT_RECORDED for name in STRATA} | {"task": contract.task},
        flags=dict.fromkeys(FLAGS, None),
        scene_start="",
        source_file=label,
        source_sha256=digest,
        content_sha256=content,
        recorded_at_ns=int(tick_ns[0]),
        clock_offsets_ns={},
    )


def _array(folder: Path) -> NDArray[Any]:
    """A whole numeric zarr v2 array, its description checked before it is decoded."""
    place = str(folder)
    head = read_json(folder / ".zarray")
    try:
        kind, shape, compressor = head["dtype"], list(head["shape"]), head["compressor"]
        size = math.prod(int(n) for n in shape) * int(str(kind)[2:])
        codec = None if compressor is None else compressor["id"]
        plain = kind in NUMERIC_TYPES and not head["filters"] and head["zarr_format"] == 2
    except (KeyError, TypeError, ValueError) as error:
        raise ContractError(
            where=f"{place}/.zarray",
            found=f"not an array description ({error!r:.80})",
            expected="zarr version 2",
            action=ACTION,
        ) from error
    if not plain or codec not in (None, *COMPRESSORS):
        _refuse(f"{place}/.zarray", f"of type {kind!r:.20}, codec {codec!r:.20}", "plain numbers")
    if not 0 < size <= MAXIMUM_ARRAY_BYTES:
        _refuse(place, f"{size} bytes", f"1 to {MAXIMUM_ARRAY_BYTES}")
    try:
        array = zarr.open_array(str(folder), mode="r", zarr_format=2)
        if array.nchunks_initialized != array.nchunks:
            _refuse(place, f"{array.nchunks_initialized} chunks", f"all {array.nchunks} of them")
        return np.asarray(array[:])
    except BadInputError:
        raise
    except Exception as error:  # decoders raise whatever they like on changed bytes
        raise IntegrityError(
            where=place,
            found=f"not decodable ({' '.join(str(error).split())[:120]})",
            expected="whole chunks",
            action=ACTION,
        ) from error


def _check_shapes(
    path: Path, state: Array, action: Array, ends: NDArray[Any], contract: ReplayBufferContract
) -> None:
    rows = len(state)
    if state.ndim != 2 or state.shape[1] != contract.state_width:
        _refuse(f"{path}/data/state", f"of shape {state.shape}", f"(N, {contract.state_width})")
    if action.shape != (rows, contract.action.dim):
        _refuse(
            f"{path}/data/action", f"of shape {action.shape}", f"({rows}, {contract.action.dim})"
        )
    steps = np.diff(ends, prepend=0)
    if ends.ndim != 1 or not (steps > 0).all() or ends[-1] != rows:
        _refuse(f"{path}/meta/episode_ends", "not rising to the last row", f"cumulative to {rows}")


def _refuse(where: str, found: str, expected: str) -> NoReturn:
    raise ContractError(where=where, found=found, expected=expected, action=ACTION)
