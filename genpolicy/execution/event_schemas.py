"""JSON schema of each kind of event, in the words that public viewers of MCAP files read.

The reader that Foxglove published last and Lichtblick's know one plain type a field, ask for the
`properties` of each object and the `items` of each array, and know no `null`. So an object whose
keys vary has no property by name, and a field that may be null or holds words beside numbers is
required but not described: what it holds is in the message, and a type that it has not would be
a lie.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from genpolicy.contract.latency import Term

Json = dict[str, Any]

_TEXT, _WHOLE, _NUMBER, _FLAG = (
    {"type": name} for name in ("string", "integer", "number", "boolean")
)
_ANY: Json = {"type": "object", "properties": {}}
_NUMBERS: Json = {"type": "array", "items": _NUMBER}
_TYPES: Mapping[str, Json] = {
    **dict.fromkeys(
        ("session", "fallback_hash", "controller_mode", "phase", "calibration_epoch",
         "ignored_because", "old", "new", "checkpoint", "sampler", "mode", "id", "stage", "detail",
         "history", "chunk_id", "invocation", "rule", "method", "source", "predecessor", "raw",
         "actions_sha256", "sha256", "ended", "at", "reason", "action", "event", "state", "cause",
         "outcome", "who"),
        _TEXT,
    ),
    **dict.fromkeys(
        ("n", "t", "version", "execution_horizon", "period_ns", "watchdog_ns", "queue_capacity",
         "replan_lead_rows", "event_time_ns", "draw", "index", "arrival", "condition_ns",
         "start_ns", "valid_until_ns", "session_epoch", "row", "sequence", "age_ns", "failures",
         "before_ns", "events", "exposed_ns"),
        _WHOLE,
    ),
    **dict.fromkeys(
        ("force_n", "duration_s", "gripper_m", "maximum_divergence_m",
         "maximum_scene_shift_m", *(f"{term}_s" for term in Term)),
        _NUMBER,
    ),
    **dict.fromkeys(("q_rad", "tcp_m", "tcp_rotation"), _NUMBERS),
    **dict.fromkeys(("used", "in_contact"), _FLAG),
    **dict.fromkeys(
        ("labels", "maximum_age_ns", "late_chunk", "bodies", "parents", "layers", "measures",
         "chunks"),
        _ANY,
    ),
    "checks_missing": {"type": "array", "items": _TEXT},
    "checked_rows": {"type": "array", "items": _WHOLE},
}  # fmt: skip
_BY_KIND: Mapping[tuple[str, str], Json] = {
    ("enqueue", "actions"): _TEXT,
    ("enqueue", "rows"): _WHOLE,
    ("conditioning", "rows"): _WHOLE,
    ("end", "actions"): _ANY,
    ("discard", "rows"): _ANY,
    ("finish", "rows"): _ANY,
}
"""What one name holds in one kind of event and not in another."""
NOT_DESCRIBED = {
    ("conditioning", "key"), ("candidate", "first_reason"), ("enqueue", "motion"),
    ("observation", "divergence_m"),
}  # fmt: skip
"""Fields that may be null, or that hold words beside numbers."""


def schema_name(kind: str) -> str:
    """The name of a kind's schema."""
    return f"genpolicy.journal.{kind}"


def event_schema(kind: str, fields: Sequence[str]) -> Json:
    """The schema of one kind of event.

    Args:
        kind: Its name.
        fields: Of its payload.

    Raises:
        KeyError: A field of which nobody says what it holds.
    """
    names = ("session", "n", "t", *fields)
    return {
        "type": "object",
        "properties": {
            name: _BY_KIND.get((kind, name)) or _TYPES[name]
            for name in names
            if (kind, name) not in NOT_DESCRIBED
        },
        "required": list(names),
    }
