"""One data set: recorded, audited, and compared with what was planted."""

import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from benchmarks.audit.cases import CAUSES
from benchmarks.audit.recorder import TASKS, record
from benchmarks.audit.settings import SETTINGS
from gates.cause import Cause, cause_of, default_limits
from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.run import AuditResult, audit
from genpolicy.audit.settings import AuditSettings


@dataclass(frozen=True)
class Job:
    """One data set to be.

    Attributes:
        cause: Place in the catalogue.
        strength: Strength of the cause.
        task: planar or insertion.
        seed: Seed of the data set.
    """

    cause: int
    strength: float
    task: str
    seed: int


@dataclass(frozen=True)
class Result:
    """What the audit said of one data set.

    Attributes:
        job: The data set.
        name: Name of the planted cause.
        group: Row of the confusion matrix.
        strong: Whether the strength is at least the stated minimum.
        verdict: Cause that was said.
        variable: Variable that was named.
        kind: Kind that was named.
        named: Whether it is the planted cause.
        right: The same, or below the minimum also what would be said without it.
        detail: Numbers that tell which layer decided.
        cpu_s: Processor time of recording and audit.
    """

    job: Job
    name: str
    group: str
    strong: bool
    verdict: str
    variable: str
    kind: str
    named: bool
    right: bool
    detail: dict[str, object]
    cpu_s: float

    def as_row(self) -> dict[str, object]:
        """One flat row."""
        row = asdict(self)
        row.update(row.pop("job"))
        row["cause"] = self.name
        return row

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> "Result":
        """A result from its flat row."""
        number = next(k for k, item in enumerate(CAUSES) if item.name == row["cause"])
        job = Job(number, row["strength"], row["task"], row["seed"])
        return cls(job=job, **{name: row[name] for name in cls.__annotations__ if name != "job"})


def judged(result: AuditResult, settings: AuditSettings, *, keep: Path | None = None) -> Cause:
    """The cause from the written evidence, under the packaged limits.

    Args:
        result: The audit.
        settings: What it was made with.
        keep: Folder for the evidence; None keeps none.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = keep or Path(name)
        folder.mkdir(parents=True, exist_ok=True)
        write_evidence(result, folder, settings=settings)
        return cause_of(folder, default_limits())


def run(job: Job, *, keep: Path | None = None) -> Result:
    """Record and audit one data set; a wrong answer is said at once."""
    cause = CAUSES[job.cause]
    begin = time.process_time()
    with threadpool_limits(1):
        plan = cause.plan(job.seed, job.strength, job.task)
        labelled = record(job.task, plan)
        result = audit(
            labelled.data,
            SETTINGS[job.task],
            admissible=TASKS[job.task].admissible(plan),
            replay=labelled.outcomes.__getitem__,
            root_seed=job.seed,
        )
    verdict = judged(result, SETTINGS[job.task], keep=keep)
    said = (verdict.name.value, verdict.variable, verdict.kind)
    named = any(answer.fits(*said) for answer in cause.answers)
    strong = cause.strong(job.strength)
    weak = not strong and any(answer.fits(*said) for answer in cause.weaker)
    if not (named or weak):
        place = f"{cause.name} {job.strength:g} {job.task} {job.seed}"
        print(f"{place}: {said[0]}({said[1]}, {said[2]})", file=sys.stderr, flush=True)
    return Result(
        job=job, name=cause.name, group=cause.group, strong=strong,
        verdict=said[0], variable=said[1], kind=said[2], named=named, right=named or weak,
        detail={
            "layer": str(verdict.topic.value), "action": verdict.next_action,
            "confidence": verdict.confidence, **asdict(result.counts),
        },
        cpu_s=time.process_time() - begin,
    )  # fmt: skip
