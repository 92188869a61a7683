"""Which questions to the data may be waived: those of the code, of the task and of its contract.

A plan is written before the data are there. So a waiver is held against what could be asked, not
against what these data happen to ask: one that they do not need is a remark, no mistake.
"""

from collections.abc import Iterable
from typing import Any

from gates.evidence import Evidence, MissingEvidenceError
from gates.pipeline import TASK_IDENTITY
from genpolicy.audit.question_names import ALWAYS, CLOCK, COLUMN, FROZEN, PAST
from genpolicy.errors import ConfigError

MANIFEST = "artifacts/ingest/manifest.json"
"""Holds the observation contract, which the stages hold to that of the task."""


def require_questions(names: Iterable[str], evidence: Evidence) -> None:
    """Refuse waivers of what could be asked of no data of this task: they are misspelt.

    Args:
        names: Questions that are waived, and that these data do not ask.
        evidence: Where the task's phases and streams stand.

    Raises:
        ConfigError: No question has that name.
        MissingEvidenceError: What would tell is missing.
    """
    for name in sorted(names):
        possible = _like(name, evidence)
        if name not in possible:
            raise ConfigError(
                where=f"params.yaml: gate_a.waived_checks: {name}",
                found="a waiver of no question",
                expected=f"one of {', '.join(possible)}",
                action="Correct the name; a misspelt waiver would waive nothing.",
            )


def _like(name: str, evidence: Evidence) -> tuple[str, ...]:
    """Questions of the kind of `name` that could be asked of data of this task."""
    kind = name[: name.find(".") + 1]
    if kind == PAST:
        return tuple(f"{PAST}{phase}" for phase in _phases(evidence))
    if kind in (CLOCK, FROZEN):
        return tuple(f"{kind}{stream}" for stream in _streams(evidence))
    if kind == COLUMN:
        return (name if name != COLUMN else f"{COLUMN}<name>",)
    return (*ALWAYS, *(f"{kind}<name>" for kind in (CLOCK, FROZEN, COLUMN, PAST)))


def _phases(evidence: Evidence) -> list[str]:
    return [str(phase) for phase in _list_at(evidence, TASK_IDENTITY, "phases", "all")]


def _streams(evidence: Evidence) -> list[str]:
    channels = _list_at(evidence, MANIFEST, "observation_contract", "channels")
    return sorted({str(item.get("stream")) for item in channels if isinstance(item, dict)})


def _list_at(evidence: Evidence, path: str, *keys: str) -> list[Any]:
    value: Any = evidence.document(path)
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    if not isinstance(value, list):
        raise MissingEvidenceError(f"{path} holds no list {'.'.join(keys)}")
    return value
