"""One recording: written, imported, audited as a user would, and held against its truth."""

import tempfile
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from benchmarks.audit_real.catalogue import Case, made
from benchmarks.audit_real.truth import WRONG
from benchmarks.audit_real.writers import write
from gates.cause import Cause, cause_of, default_limits
from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.propose import propose_settings
from genpolicy.audit.standalone import audit
from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset
from genpolicy.errors import GenpolicyError

FAILED = "error"


@dataclass(frozen=True)
class Result:
    """What the audit said of one recording.

    Attributes:
        base: Name of the base.
        changes: Names of the changes, with the strength of each.
        seed: Seed of the case.
        wanted: Right verdicts, in words.
        verdict: Cause that was said; `error` where it ended with one.
        variable: Variable that was named; the text of an error.
        kind: Kind that was named.
        confidence: Confidence that was said; None without one.
        judged: Right, allowed undecided, undecided or wrong.
        rows: Rows that were audited.
        wall_s: Seconds of import and audit.
    """

    base: str
    changes: tuple[tuple[str, float], ...]
    seed: int
    wanted: str
    verdict: str
    variable: str
    kind: str
    confidence: float | None
    judged: str
    rows: int
    wall_s: float

    @property
    def case(self) -> Case:
        """The case that it is of."""
        return Case(self.base, self.changes, self.seed)

    @property
    def said(self) -> str:
        """The verdict in words."""
        named = ", ".join(dict.fromkeys(part for part in (self.variable, self.kind) if part))
        return f"{self.verdict}({named})" if named else self.verdict

    def as_row(self) -> dict[str, Any]:
        """One flat row."""
        return asdict(self)

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> "Result":
        """A result from its flat row."""
        changes = tuple((str(name), float(strength)) for name, strength in row["changes"])
        return cls(**{**row, "changes": changes})


def run(case: Case) -> Result:
    """Make, write, import and audit one recording."""
    recording = made(case)
    begin = time.monotonic()
    confidence: float | None = None
    with tempfile.TemporaryDirectory() as name, threadpool_limits(1):
        path = write(recording, Path(name) / "recordings")
        begin = time.monotonic()
        try:
            cause = audited(path, Path(name))
        except GenpolicyError as error:
            said = (FAILED, " ".join(str(error).split())[:160], "")
            judged = WRONG
        else:
            said = (cause.name.value, cause.variable, cause.kind)
            judged, confidence = recording.truth.judged(*said), cause.confidence
    return Result(
        base=case.base, changes=case.changes, seed=case.seed, wanted=recording.truth.as_text(),
        verdict=said[0], variable=said[1], kind=said[2], confidence=confidence, judged=judged,
        rows=sum(len(episode) for episode in recording.episodes),
        wall_s=round(time.monotonic() - begin, 2),
    )  # fmt: skip


def audited(path: Path, work: Path) -> Cause:
    """The cause that `genpolicy audit` names, under the packaged limits."""
    opened = open_dataset(path, out=work / "dataset")
    dataset = load_dataset(opened.folder)
    settings = propose_settings(dataset, source=opened.contract.model_dump(mode="json"))
    report = audit(dataset, settings)
    evidence = work / "evidence"
    evidence.mkdir()
    write_evidence(report.result, evidence, settings=settings)
    return cause_of(evidence, default_limits())
