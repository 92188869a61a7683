"""What the log of a replay says of an event, and how loudly."""

from collections.abc import Mapping
from typing import Any

from genpolicy.execution.supervisor import STOPPED
from genpolicy.replay.messages import ERROR, INFO, WARNING


def said_of(kind: str, payload: Mapping[str, Any]) -> tuple[int, str] | None:  # noqa: PLR0911
    """Level and text of an event; None where it is no news.

    Args:
        kind: Kind of the event.
        payload: What it states.
    """
    if kind == "session":
        labels = ", ".join(f"{name} {value}" for name, value in payload["labels"].items())
        return INFO, f"session: {labels}" if labels else "session"
    if kind == "candidate":
        return _candidate(payload)
    if kind in ("phase", "epoch", "mode", "recovery"):
        text = f"{kind}: {payload['old'] or 'none'} to {payload['new']}"
        cause = payload.get("cause")
        return (WARNING if cause else INFO), text + (f" ({cause})" if cause else "")
    if kind in ("hold", "discard", "refuse", "invalidate"):
        chunk = f" {payload['chunk_id']}" if "chunk_id" in payload else ""
        return (
            INFO if kind in ("hold", "discard") else WARNING
        ), f"{kind}{chunk}: {payload['reason']}"
    if kind == "supervisor":
        detail = f" ({payload['detail']})" if payload["detail"] else ""
        text = f"supervisor: {payload['event']}, now {payload['state']}{detail}"
        if payload["state"] in STOPPED:
            return ERROR, text
        return (WARNING if payload["event"] == "watchdog" else INFO), text
    if kind == "reset":
        return WARNING, f"reset: session epoch {payload['session_epoch']}"
    if kind == "person":
        return WARNING, f"person: {payload['who']} {payload['stage'].replace('_', ' ')}"
    if kind == "outcome":
        return INFO, f"outcome: {payload['outcome']}"
    return None


def _candidate(payload: Mapping[str, Any]) -> tuple[int, str] | None:
    if not payload["first_reason"]:
        return None
    name = f"{payload['chunk_id']} candidate {payload['index']}"
    return WARNING, f"rejected {name}: {payload['first_reason']}"
