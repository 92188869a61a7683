"""What a gate stage has judged: its own exit code says only that it ran, its report the verdict."""

from pathlib import Path

from genpolicy.errors import BadInputError
from genpolicy.integrity.documents import read_json, read_yaml

PENDING = "PENDING_REVIEW"
GOES_ON = ("PASS", PENDING)
"""Verdicts that stop no ladder: a gate that waits for people has said what it can."""


def judged(workspace: Path, stage: str) -> tuple[str, str]:
    """Verdict of a gate stage that has just run, and one sentence about it.

    Raises:
        BadInputError: It left no report, or one without verdict.
    """
    path = workspace / "reports" / f"{stage}.json"
    document = read_json(path)
    verdict = document.get("verdict") if isinstance(document, dict) else None
    if not isinstance(verdict, str):
        raise BadInputError(
            where=str(path),
            found="without a verdict",
            expected="the report of a gate",
            action=f"Run `dvc repro -f {stage}`.",
        )
    words = (f"{stage}: {verdict}.", document.get("decision"), document.get("diagnosis"))
    return verdict, " ".join(str(word) for word in words if word)


def last_gate(workspace: Path) -> str:
    """The last gate stage of `dvc.yaml`, whose verdict no stage behind it asks; empty without."""
    stages = read_yaml(workspace / "dvc.yaml").get("stages") or {}
    return next((name for name in reversed(list(stages)) if name.startswith("gate_")), "")
