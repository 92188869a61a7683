"""The journal: every event of a session, append-only, and its MCAP file.

One session is one rollout. An event is `(n, kind, time_ns, payload)` where `n` counts from 0 in
its session. In the file each kind has its topic (`/journal/<kind>`), `log_time` is the event's
time, and the JSON message is the payload plus `session`, `n` and `t`. Arrays of actions are hex
of little-endian float64 rows, so that equality is equality of bits (`decode_actions`).
"""

import hashlib
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from numpy.typing import ArrayLike, NDArray

from genpolicy.contract.action import ACTION_DIM
from genpolicy.contract.latency import Term
from genpolicy.errors import BadInputError, ContractError
from genpolicy.execution.believed import BelievedClock
from genpolicy.execution.cell import FALLBACK_HASH, Cell
from genpolicy.execution.event_schemas import event_schema, schema_name
from genpolicy.execution.nanoseconds import to_ns
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes_of

Array = NDArray[np.float64]

JOURNAL_VERSION = 12
MAXIMUM_UNCOMPRESSED_BYTES = 8 << 30
MAXIMUM_CHUNK_BYTES = 64 << 20  # what is unpacked at once; every record lies in such a piece

EVENT_FIELDS: dict[str, tuple[str, ...]] = {
    "session": ("version", "labels", "execution_horizon", "period_ns", "maximum_age_ns",
                "watchdog_ns", "queue_capacity", "replan_lead_rows", "late_chunk",
                "fallback_hash", "controller_mode", "maximum_divergence_m",
                "maximum_scene_shift_m", "checks_missing"),
    "observation": ("event_time_ns", "phase", "calibration_epoch", "used", "ignored_because",
                    "divergence_m", "tcp_m"),
    "scene": ("bodies",),
    "state": ("q_rad", "tcp_m", "tcp_rotation", "gripper_m", "force_n"),
    "exposure": ("sha256",),
    "arrived": ("exposed_ns",),
    "phase": ("event_time_ns", "old", "new"),
    "epoch": ("event_time_ns", "old", "new"),
    "active": ("checkpoint", "sampler"),
    "controller": ("mode",),
    "invocation": ("id", "stage", "detail"),
    "conditioning": ("id", "exposed_ns", "key", "rows", "history"),
    "latency": ("id", *(f"{term}_s" for term in Term)),
    "joined": ("chunk_id", "invocation", "rule", "draw", "parents"),
    "candidate": ("chunk_id", "method", "index", "layers", "first_reason", "measures"),
    "enqueue": ("arrival", "chunk_id", "source", "method", "condition_ns", "start_ns", "period_ns",
                "valid_until_ns", "phase", "calibration_epoch", "checkpoint", "sampler",
                "session_epoch", "predecessor", "rows", "raw", "actions", "actions_sha256",
                "checked_rows", "layers", "motion"),
    "discard": ("arrival", "chunk_id", "at", "reason", "ended", "rows"),
    "finish": ("arrival", "chunk_id", "ended", "rows"),
    "accept": ("arrival", "chunk_id", "row", "sequence", "age_ns", "action"),
    "fallback": ("arrival", "chunk_id", "row", "sequence", "age_ns", "action"),
    "refuse": ("arrival", "chunk_id", "row", "reason"),
    "hold": ("reason",),
    "supervisor": ("event", "state", "detail"),
    "recovery": ("old", "new", "cause", "phase", "failures"),
    "person": ("stage", "who"),
    "invalidate": ("reason", "before_ns"),
    "mode": ("old", "new"),
    "reset": ("session_epoch",),
    "recovery_force": ("force_n",),
    "force": ("force_n",),
    "push": ("force_n", "duration_s", "in_contact"),
    "outcome": ("outcome", "mode"),
    "end": ("chunks", "actions", "events"),
}  # fmt: skip
"""Payload of each kind of event; `session`, `n` and `t` (ns) are in every message."""


@dataclass(frozen=True, slots=True)
class Event:
    """One event as read back: which session, its number there, kind, time in ns and payload."""

    session: str
    n: int
    kind: str
    t: int
    payload: dict[str, Any]


class Journal(BelievedClock):
    """Append-only events of one session, on the clock that they are dated by.

    Args:
        session: Name of the rollout, unique within a file.
        labels: Free text about it (method, perturbation, start), written with the first event.
    """

    def __init__(self, session: str, labels: Mapping[str, str] | None = None) -> None:
        super().__init__()
        self.session = session
        self.labels = dict(labels or {})
        self._events: list[tuple[str, int, dict[str, Any]]] = []

    def __len__(self) -> int:
        return len(self._events)

    def add(self, kind: str, time_ns: int, payload: dict[str, Any]) -> None:
        """Append an event; the payload is kept, not copied, and must not change afterwards."""
        self._events.append((kind, time_ns, payload))

    def candidate(
        self,
        now_s: float,
        *,
        chunk_id: str,
        method: str,
        index: int,
        layers: Mapping[str, bool | None],
        first_reason: str | None,
        measures: Mapping[str, Any] | None = None,
    ) -> None:
        """Record the verdict on one candidate: passed, failed or not reached, per layer.

        `measures` is what else was found of it, where a table states that too.
        """
        payload = {
            "chunk_id": chunk_id, "method": method, "index": index, "layers": dict(layers),
            "first_reason": first_reason, "measures": dict(measures or {}),
        }  # fmt: skip
        self.add("candidate", self.clock(now_s), payload)

    def scene(self, now_s: float, poses: Mapping[str, tuple[ArrayLike, ArrayLike]]) -> None:
        """Record where bodies of the scene were seen: positions, m, and quaternions, by name."""
        self.add("scene", self.clock(now_s), {"bodies": encode_poses(poses)})

    def exposure(self, now_s: float, observation: Array) -> None:
        """Record that something was exposed, and its hash: what an invocation says it saw is this.

        Args:
            now_s: Time, s.
            observation: What was seen. Shape (D_o,).
        """
        seen = hashlib.sha256(np.ascontiguousarray(observation, dtype="<f8").tobytes())
        self.add("exposure", self.clock(now_s), {"sha256": seen.hexdigest()})

    def arrived(self, now_s: float, *, exposed_s: float) -> None:
        """Record that what was exposed at a time is there now."""
        self.add("arrived", self.clock(now_s), {"exposed_ns": to_ns(exposed_s)})

    def invocation(self, now_s: float, *, invocation_id: str, stage: str, detail: str = "") -> None:
        """Record the begin of an invocation, the check of another candidate, or the end."""
        payload = {"id": invocation_id, "stage": stage, "detail": detail}
        self.add("invocation", self.clock(now_s), payload)

    def conditioning(
        self,
        now_s: float,
        *,
        invocation_id: str,
        exposed_s: float,
        key: Sequence[str | int],
        history: Array,
    ) -> None:
        """Record what an invocation draws from, so that anybody can draw again.

        Args:
            now_s: Time, s.
            invocation_id: The invocation.
            exposed_s: When the newest observation that it sees was exposed, s.
            key: Names of its noise; with the checkpoint they say which numbers are drawn.
            history: The observations that it sees, oldest first. Shape (H_o, D_o).
        """
        payload = {
            "id": invocation_id, "exposed_ns": to_ns(exposed_s), "key": list(key),
            "rows": len(history), "history": encode_actions(history),
        }  # fmt: skip
        self.add("conditioning", self.clock(now_s), payload)

    def last(self, *kinds: str) -> dict[str, Any] | None:
        """Payload of the newest event of one of these kinds; None without one."""
        return next((payload for kind, _, payload in reversed(self._events) if kind in kinds), None)

    def events(self) -> list[Event]:
        """The events so far, in order."""
        return [
            Event(self.session, n, kind, time_ns, payload)
            for n, (kind, time_ns, payload) in enumerate(self._events)
        ]


def session_payload(
    cell: Cell,
    *,
    labels: Mapping[str, str],
    checks_missing: Sequence[str],
) -> dict[str, Any]:
    """Payload of the first event: what the session is held to."""
    return {
        "version": JOURNAL_VERSION,
        "labels": dict(labels),
        "execution_horizon": cell.horizons.execution_horizon,
        "period_ns": cell.period_ns,
        "maximum_age_ns": cell.maximum_age_ns,
        "watchdog_ns": cell.watchdog_ns,
        "queue_capacity": cell.execution.queue_capacity,
        "replan_lead_rows": cell.execution.replan_lead_rows,
        "late_chunk": cell.execution.late_by_phase,
        "fallback_hash": FALLBACK_HASH,
        "controller_mode": cell.controller_mode,
        "maximum_divergence_m": cell.execution.maximum_divergence_m,
        "maximum_scene_shift_m": cell.execution.maximum_scene_shift_m,
        "checks_missing": list(checks_missing),
    }


def encode_actions(actions: Array) -> str:
    """Hex of the little-endian float64 bytes, row after row."""
    return np.ascontiguousarray(actions, dtype="<f8").tobytes().hex()


def encode_poses(poses: Mapping[str, tuple[ArrayLike, ArrayLike]]) -> dict[str, str]:
    """Hex of x, y, z, m, and w, x, y, z of each body, by name, in the order of names."""
    return {
        name: encode_actions(np.concatenate([np.ravel(part) for part in poses[name]]))
        for name in sorted(poses)
    }


def decode_actions(text: str) -> Array:
    """Inverse of `encode_actions`. Shape (rows, 10)."""
    return np.frombuffer(bytes.fromhex(text), dtype="<f8").reshape(-1, ACTION_DIM)


def write_journal(path: Path, sessions: Iterable[Journal]) -> None:
    """Write sessions into one MCAP file: same events, same bytes.

    Raises:
        ContractError: Two sessions have one name, or an event is of no known kind.
        BadInputError: The place cannot be written.
    """
    buffer = io.BytesIO()
    writer = Writer(buffer, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(profile="", library="genpolicy")
    channels: dict[str, int] = {}
    for kind, fields in EVENT_FIELDS.items():
        schema = canonical_json(event_schema(kind, fields))
        schema_id = writer.register_schema(schema_name(kind), "jsonschema", schema)
        channels[kind] = writer.register_channel(f"/journal/{kind}", "json", schema_id)
    encode = json.JSONEncoder(separators=(",", ":"), allow_nan=False).encode
    names: set[str] = set()
    for journal in sessions:
        if journal.session in names:
            raise ContractError(
                where=str(path),
                found=f"two sessions named {journal.session!r}",
                expected="unique session names",
                action="Name each rollout once.",
            )
        names.add(journal.session)
        for n, (kind, time_ns, payload) in enumerate(journal._events):
            message = {"session": journal.session, "n": n, "t": time_ns, **payload}
            writer.add_message(
                channels[kind],
                log_time=max(time_ns, 0),
                data=encode(message).encode(),
                publish_time=max(time_ns, 0),
                sequence=n,
            )
    writer.finish()  # type: ignore[no-untyped-call]
    write_bytes(path, buffer.getvalue())


def read_journal(path: Path) -> dict[str, list[Event]]:
    """Events of each session of a journal file, in order.

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole, well-formed journal.
    """
    _, data = sha256_bytes_of(path, keep=True)
    sessions: dict[str, list[Event]] = {}
    try:
        reader = make_reader(io.BytesIO(data), validate_crcs=True)
        summary = reader.get_summary()
        if summary is None or summary.statistics is None:
            raise ValueError("no summary")
        sizes = [index.uncompressed_size for index in summary.chunk_indexes]
        if sum(sizes) > MAXIMUM_UNCOMPRESSED_BYTES or max(sizes, default=0) > MAXIMUM_CHUNK_BYTES:
            raise ValueError(f"{sum(sizes)} bytes uncompressed, {max(sizes)} in one piece")
        for _, channel, message in reader.iter_messages(log_time_order=False):
            payload = json.loads(message.data)
            session, n, time_ns = payload.pop("session"), payload.pop("n"), payload.pop("t")
            kind = channel.topic.removeprefix("/journal/")
            sessions.setdefault(session, []).append(Event(session, n, kind, time_ns, payload))
    except Exception as error:  # damaged bytes make the readers below raise almost anything
        raise BadInputError(
            where=str(path),
            found=f"no journal ({type(error).__name__}: {error})",
            expected="a whole MCAP journal",
            action="Re-run the stage that writes it.",
        ) from error
    return sessions
