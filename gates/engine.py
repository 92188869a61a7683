"""The judge that all gates share: measure each criterion, hold it against its limit, combine.

Pure: the report is a function of the evidence, the thresholds and the settings.
"""

import importlib.metadata
import math
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gates.evidence import Evidence, MissingEvidenceError
from gates.models import (
    GATES,
    REQUIRED,
    SCHEMA_VERSION,
    Comparison,
    Criterion,
    Gate,
    GateReport,
    Owner,
    StrictModel,
    Threshold,
    Verdict,
    parse_report,
    report_path,
)
from gates.verdicts import combine, first_unmet, judge_criterion, rounded
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.integrity.hashing import sha256_bytes_of

LIBRARIES = ("numpy", "pandas", "pyarrow", "pydantic", "scipy")
REGIME = (
    "bit-equal for the same wheels, CPU capability, one thread and one batch shape; "
    "elsewhere samples within 1e-5 and the same verdict"
)


@dataclass(frozen=True)
class Measured:
    """What a criterion found.

    Attributes:
        value: The number; None where nothing can be said.
        interval: Its interval, if it has one.
        caveat: What the reader must know about it.
        pending: Set where only a person can supply the answer and has not yet.
    """

    value: float | None
    interval: tuple[float, float] | None = None
    caveat: str = ""
    pending: bool = False


@dataclass(frozen=True)
class Case:
    """What a measure may look at: evidence, settings, and the candidate it is about."""

    evidence: Evidence
    params: Any
    candidate: str = ""
    extra: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class CriterionSpec:
    """A criterion of a gate: its question and how it is measured."""

    id: str
    question: str
    comparison: Comparison
    owner: Owner
    evidence: tuple[str, ...]
    measure: Callable[[Case], Measured]
    look_at: str
    per_candidate: bool = False
    route: str = REQUIRED


@dataclass(frozen=True)
class GateSpec:
    """A gate: its criteria in the order in which a failure is diagnosed.

    Attributes:
        bind: Glob patterns of files that the report binds without reading them.
        back_to: Where a failure sends the reader.
        go_on: What a pass allows.
        caveats: What the gate does not show.
    """

    gate: Gate
    criteria: tuple[CriterionSpec, ...]
    bind: tuple[str, ...]
    back_to: str
    go_on: str
    caveats: tuple[str, ...]

    @property
    def has_candidates(self) -> bool:
        """Whether methods stand for promotion here."""
        return any(spec.per_candidate for spec in self.criteria)


def check_thresholds(spec: GateSpec, thresholds: Mapping[str, Threshold]) -> None:
    """Refuse thresholds of criteria that the gate does not have.

    Raises:
        ConfigError: An unknown identifier.
    """
    known = {item.id for item in spec.criteria}
    for name in sorted(set(thresholds) - known):
        raise ConfigError(
            where=f"params.yaml: gate_{spec.gate.lower()}.thresholds.{name}",
            found="a threshold of no criterion",
            expected=f"one of {', '.join(sorted(known))}",
            action="Correct the name; a misspelt threshold would judge nothing.",
        )


def judge_gate(
    spec: GateSpec,
    evidence: Evidence,
    thresholds: Mapping[str, Threshold],
    params: StrictModel,
    *,
    candidates: Sequence[str] = (),
    caveats: Sequence[str] = (),
    extra: Mapping[str, Any] | None = None,
    diagnosis: Callable[[Sequence[Criterion], Verdict], str] | None = None,
    decision: Callable[[Sequence[Criterion], Verdict, dict[str, Verdict]], str] | None = None,
) -> GateReport:
    """Report of one gate.

    Args:
        spec: The gate.
        evidence: What it may read.
        thresholds: Limits by criterion; a criterion without one is INCONCLUSIVE.
        params: The gate's other settings, recorded in the report.
        candidates: Methods that stand for promotion.
        caveats: Caveats of this run, beside those of the gate.
        extra: Further inputs of the measures.
        diagnosis: Own text for what failed; the default names the first unmet criterion.
        decision: Own text for what follows.

    Raises:
        ConfigError: A threshold of no criterion.
        IntegrityError: Evidence that is not what it claims to be.
    """
    check_thresholds(spec, thresholds)
    criteria = []
    for item in spec.criteria:
        for name in candidates if item.per_candidate else ("",):
            case = Case(evidence, params, name, extra or {})
            criteria.append(_judge(item, case, thresholds.get(item.id)))
    verdict, verdicts = combine(criteria, expects_candidates=spec.has_candidates)
    if not thresholds:
        verdict = "INCONCLUSIVE"
    evidence.bind(*spec.bind)
    text = (diagnosis or default_diagnosis(spec))(criteria, verdict)
    decided = decision(criteria, verdict, verdicts) if decision else _decision(spec, verdict)
    return GateReport(
        schema_version=SCHEMA_VERSION,
        gate=spec.gate,
        verdict=verdict,
        candidates=verdicts,
        criteria=tuple(criteria),
        materials=evidence.materials,
        upstream=upstream_hashes(evidence.root, spec.gate),
        settings=params.model_dump(mode="json"),
        environment=environment(),
        caveats=(*spec.caveats, *caveats),
        diagnosis=text,
        decision=decided,
    )


def default_diagnosis(spec: GateSpec) -> Callable[[Sequence[Criterion], Verdict], str]:
    """Names the first unmet criterion in order of diagnosis, and where to look."""
    texts = {item.id: item.look_at for item in spec.criteria}

    def text(criteria: Sequence[Criterion], verdict: Verdict) -> str:
        decided = first_unmet(criteria, verdict)
        if decided is None:
            return "" if verdict == "PASS" else "Nothing was judged: criteria or thresholds lack."
        of = f" of {decided.candidate}" if decided.candidate else ""
        why = f" ({decided.caveat})" if decided.measured is None and decided.caveat else ""
        return f"First unmet: {decided.id}{of}{why}. {texts[decided.id]}"

    return text


def _decision(spec: GateSpec, verdict: Verdict) -> str:
    if verdict == "PASS":
        return spec.go_on
    if verdict == "PENDING_REVIEW":
        return "Wait for the independent reviewer and the four owners."
    if verdict == "INCONCLUSIVE":
        return "No decision: complete the evidence, then judge again."
    return f"Return to {spec.back_to}."


def upstream_hashes(root: Path, gate: Gate) -> dict[str, str]:
    """SHA-256 of the reports below `gate`, by gate; those that are missing are left out."""
    found: dict[str, str] = {}
    for below in GATES[: GATES.index(gate)]:
        path = root / report_path(below)
        if path.is_file():
            found[below] = sha256_bytes_of(path, keep=False)[0]
    return found


def standing(root: Path, below: Gate, wanted: Sequence[str]) -> tuple[list[str], list[str]]:
    """The wanted methods that passed the gate below, and why the others do not stand.

    A report that is missing or unreadable lets no method stand; admission proves the report.
    """
    path = root / report_path(below)
    try:
        report = parse_report(sha256_bytes_of(path, keep=True)[1], gate=below)
    except IntegrityError:
        return [], [f"Gate {below} has no readable report, so no method stands here."]
    passed = [name for name in wanted if report.candidates.get(name) == "PASS"]
    left_out = [
        f"{name} does not stand here: gate {below} says {report.candidates.get(name, 'nothing')}."
        for name in wanted
        if name not in passed
    ]
    return passed, left_out


def environment() -> dict[str, str]:
    """Library versions, threads and the regime in which the numbers repeat."""
    found = {name: importlib.metadata.version(name) for name in LIBRARIES}
    found["python"] = platform.python_version()
    found["threads"] = os.environ.get("OMP_NUM_THREADS", "not set")
    found["regime"] = REGIME
    return found


def _judge(item: CriterionSpec, case: Case, threshold: Threshold | None) -> Criterion:
    try:
        measured = item.measure(case)
    except MissingEvidenceError as error:
        measured = Measured(None, caveat=f"not measured: {error}")
    value, interval = measured.value, measured.interval
    if value is not None:
        value = rounded(value) if math.isfinite(value) else None
    if interval is not None:
        interval = (rounded(interval[0]), rounded(interval[1]))
    limit = threshold.limit if threshold else None
    verdict = judge_criterion(value, limit, item.comparison)
    if measured.pending and verdict != "PASS" and limit is not None:
        verdict = "PENDING_REVIEW"
    return Criterion(
        id=item.id,
        question=item.question,
        owner=threshold.owner if threshold else item.owner,
        candidate=case.candidate or None,
        route=item.route,
        measured=value,
        interval=interval,
        threshold=limit,
        comparison=item.comparison,
        reason=threshold.reason if threshold else "no threshold in params.yaml",
        verdict=verdict,
        evidence=item.evidence,
        caveat=measured.caveat,
    )
