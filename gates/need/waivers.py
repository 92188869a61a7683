"""Which questions to the data may be waived: those of the code, of the task and of its contract.

A plan is written before the data are there. So a waiver is held against what could be asked, not
against what these data happen to ask: one that they do not need is a remark, no mistake.
"""

from collections.abc import Iterable

from gates.evidence import Evidence, MissingEvidenceError
from gates.pipeline import TASK
from genpolicy.audit.question_names import ALWAYS, CLOCK, COLUMN, FROZEN, PAST
from genpolicy.data.rows import FrameRow
from genpolicy.documents.task import IDENTITY
from genpolicy.errors import ConfigError

FRAMES = "artifacts/ingest/frames.parquet"


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
    phases = evidence.document(TASK, IDENTITY).every_phase
    if not phases:
        raise MissingEvidenceError(f"{TASK}/{IDENTITY.file} does not say which phases there are")
    return phases


def _streams(evidence: Evidence) -> list[str]:
    """Streams of the contract: ingest gives each its columns of times."""
    columns = evidence.rows(FRAMES, FrameRow).columns
    families = tuple(FrameRow.FAMILIES)
    return sorted({name.partition(".")[2] for name in columns if name.startswith(families)})
