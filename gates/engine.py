"""The judge that all gates share: measure each criterion, hold it against its limit, combine.

Pure: the report is a function of the evidence, the limits and the settings.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gates.criterion import Criterion, Measured
from gates.evidence import Evidence, MissingEvidenceError
from gates.installed import environment
from gates.more import astride, no_decision
from gates.overrides import NOBODY, Exceptions, aside, exceptions_of, rule, said
from gates.pipeline import TASK_IDENTITY, basis_of, check_record, outputs_of
from gates.preregistration import moved_caveats
from gates.protection import is_rehearsal, require_protection
from gates.report import (
    GATES,
    SCHEMA_VERSION,
    Answer,
    Gate,
    GateReport,
    Verdict,
    parse_report,
    report_path,
    stage_of,
)
from gates.running import require_running_code
from gates.settings import (
    GateSettings,
    Limit,
    Limits,
    read_limits,
    read_params,
    read_settings,
    waived_criterion,
)
from gates.verdicts import first_unmet, judge_criterion, rounded
from genpolicy.errors import IntegrityError
from genpolicy.integrity.hashing import sha256_bytes_of, sha256_file

UNRECORDED = "Judged outside the pipeline: dvc.lock holds no run of"


@dataclass(frozen=True)
class Decision:
    """What follows from a verdict, and the method that is promoted, if one is."""

    text: str
    promoted: str | None = None


@dataclass(frozen=True)
class Judged:
    """Answers and verdicts, before the words for them are found; settings as the measures had.

    What is overridden has the verdict that counts, not its own.
    """

    evidence: Evidence
    settings: Any
    answers: tuple[Answer, ...]
    verdict: Verdict
    candidates: dict[str, Verdict]


@dataclass(frozen=True)
class GateSpec:
    """A gate: its criteria in the order in which a failure is diagnosed.

    Attributes:
        gate: Letter.
        settings: Model of its settings other than limits.
        criteria: What it asks.
        bind: Glob patterns of files that the report binds without reading them.
        back_to: Where a failure sends the reader.
        go_on: What a pass allows.
        caveats: What the gate does not show.
        below: Gate that candidates must have passed to stand here; None without candidates.
        note: Text behind the diagnosis, where a gate has one.
        decide: Own decision, where the common one does not do.
        said: What the report says of the evidence beside criteria, as caveats.
        worded: A caveat of the gate in the words that fit its settings, where they matter.
    """

    gate: Gate
    settings: type[GateSettings]
    criteria: tuple[Criterion, ...]
    bind: tuple[str, ...]
    back_to: str
    go_on: str
    caveats: tuple[str, ...]
    below: Gate | None = None
    note: Callable[[Judged], str] | None = None
    decide: Callable[[Judged], Decision] | None = None
    said: Callable[[Judged], Sequence[str]] | None = None
    worded: Callable[[Any, str], str] | None = None


def judge_gate(spec: GateSpec, root: Path) -> GateReport:
    """Report of a gate from the evidence and `params.yaml` below `root`; writes nothing.

    Raises:
        ConfigError: The section is missing or wrong, or looser than the code allows.
        IntegrityError: Evidence that is not what it claims to be.
    """
    params = read_params(root)
    settings = read_settings(params, stage_of(spec.gate), spec.settings)
    found = (*require_protection(params, spec.gate), *moved_caveats(root, params, spec.gate))
    limits = read_limits(params, spec.gate, spec.criteria)
    limits = replace(limits, rehearsed=is_rehearsal(params))
    names: Sequence[str] = ()
    caveats: Sequence[str] = ()
    if spec.below is not None:
        names, caveats = promoted_below(root, spec.below, getattr(settings, "candidates", ()))
    evidence = recorded_evidence(root, spec.gate)
    report = judge(
        spec,
        evidence,
        limits,
        settings,
        candidates=names,
        caveats=(*caveats, *found),
        exceptions=exceptions_of(root, params, spec.gate),
    )
    check_record(root, spec.gate, report.materials)
    require_running_code(root)
    return report


def recorded_evidence(root: Path, gate: Gate) -> Evidence:
    """Evidence below `root` with all files of the gate's evidence stages bound, read or not.

    Raises:
        ConfigError: `dvc.yaml`, `dvc.lock` or `params.yaml` is malformed.
        IntegrityError: A file of code or evidence is a link or not readable.
    """
    evidence = Evidence(root, basis_of(root, gate))
    evidence.bind_files(outputs_of(root, gate))
    return evidence


def judge(
    spec: GateSpec,
    evidence: Evidence,
    limits: Limits,
    settings: GateSettings,
    *,
    given: object = None,
    candidates: Sequence[str] = (),
    caveats: Sequence[str] = (),
    exceptions: Exceptions = NOBODY,
) -> GateReport:
    """Report of one gate.

    Args:
        spec: The gate.
        evidence: What it may read.
        limits: By criterion; one without is INCONCLUSIVE, one not applicable a caveat.
        settings: Recorded in the report.
        given: What the measures take in place of the settings, where a gate knows more.
        candidates: Methods that stand for promotion.
        caveats: Caveats of this run, beside those of the gate.
        exceptions: Limits that somebody overrides, here and below.

    Raises:
        BadInputError: Evidence that is not what it claims, or an exception that does not fit.
    """
    inputs = settings.under(limits) if given is None else given
    answers: list[Answer] = []
    for item in spec.criteria:
        names = candidates if item.per_candidate else (None,)
        asked = [name for name in names if not settings.excepted(item.id, name)]
        answers += _answers(item, evidence, inputs, limits, asked)
    evidence.bind(*spec.bind)
    lacking, about = _lacking(evidence), spec.below is not None
    ruled = rule(exceptions, spec.criteria, answers, limits, candidates=about, lacking=lacking)
    judged = Judged(evidence, inputs, ruled.answers, ruled.verdict, ruled.candidates)
    decision = (spec.decide or _decision(spec))(judged)
    note = spec.note(judged) if spec.note else ""
    own = [spec.worded(settings, text) if spec.worded else text for text in spec.caveats]
    beside = (*_waivers(limits), *settings.caveats, *(spec.said(judged) if spec.said else ()))
    return GateReport(
        schema_version=SCHEMA_VERSION,
        gate=spec.gate,
        verdict=ruled.verdict,
        candidates=ruled.candidates,
        criteria=tuple(answers),
        materials=evidence.materials,
        upstream=upstream_hashes(evidence.root, spec.gate),
        code=dict(evidence.basis.code),
        parameters=dict(evidence.basis.parameters),
        pipeline=dict(evidence.basis.pipeline),
        settings=settings.model_dump(mode="json"),
        environment=environment(),
        caveats=(*map(said, ruled.overrides), *own, *beside, *caveats, *lacking),
        diagnosis=f"{_diagnosis(spec, judged)} {note}".strip(),
        decision=f"{decision.text} {aside(ruled.overrides)}".strip(),
        promoted=decision.promoted,
        overrides=ruled.overrides,
    )


def _answer(
    item: Criterion, evidence: Evidence, inputs: object, limit: Limit | None, candidate: str | None
) -> Answer:
    with evidence.recorded() as touched:
        try:
            measured = item.measure(evidence, inputs, *([] if candidate is None else [candidate]))
        except MissingEvidenceError as error:
            measured = Measured(None, caveat=f"not measured: {error}")
        except KeyError as error:  # a document of another form; never a traceback, never a pass
            measured = Measured(None, caveat=f"not measured: the evidence has no {error}")
    value, interval = measured.value, measured.interval
    if value is not None:
        value = rounded(value) if math.isfinite(value) else None
    if interval is not None:
        interval = (rounded(interval[0]), rounded(interval[1]))
    threshold = limit.limit if limit else None
    if limit and item.derived:
        threshold = rounded(item.derived(inputs))
    verdict = judge_criterion(value, threshold, item.comparison, interval)
    caveat = measured.caveat
    if verdict == "INCONCLUSIVE" and value is not None and threshold is not None:
        said = measured.undecided or astride(measured, threshold, item.comparison)
        caveat = f"{caveat}; {said}" if caveat else said
    if measured.pending and verdict != "PASS" and limit is not None:
        verdict = "PENDING_REVIEW"
    return Answer(
        id=item.id,
        question=item.question,
        owner=limit.owner if limit else None,
        candidate=candidate,
        measured=value,
        interval=interval,
        threshold=threshold,
        comparison=item.comparison,
        reason=limit.reason if limit else "no limit in params.yaml",
        verdict=verdict,
        evidence=tuple(touched),
        caveat=caveat,
        counted=measured.counted,
        recount=measured.recount,
    )


def _answers(
    item: Criterion,
    evidence: Evidence,
    inputs: object,
    limits: Limits,
    candidates: Sequence[str | None],
) -> Iterator[Answer]:
    """Of each who is asked; of what does not apply only where the evidence shows that it does."""
    for name in candidates:
        if item.id not in limits.waived:
            yield _answer(item, evidence, inputs, limits.of.get(item.id), name)
        elif not limits.rehearsed and (shown := _applies(item, evidence, inputs, name)):
            told = {"reason": f"declared not applicable, but {shown}"}
            yield _answer(item, evidence, inputs, None, name).model_copy(update=told)


def _applies(item: Criterion, evidence: Evidence, inputs: object, candidate: str | None) -> str:
    """What shows that a criterion applies which was declared not to; empty where nothing does."""
    if item.applies is None:
        return ""
    try:
        return item.applies(evidence, inputs, *([] if candidate is None else [candidate]))
    except (MissingEvidenceError, KeyError):
        return ""  # the criteria that are asked say what is missing


def _lacking(evidence: Evidence) -> list[str]:
    """What no gate passes without, beside its criteria, and is not there."""
    lacking = []
    if not evidence.bind(TASK_IDENTITY):
        lacking.append(f"{TASK_IDENTITY} is missing: nobody wrote which task this is about.")
    if evidence.basis.unrecorded:
        lacking.append(f"{UNRECORDED} {', '.join(evidence.basis.unrecorded)}.")
    return lacking


def _waivers(limits: Limits) -> list[str]:
    return [waived_criterion(name, waiver) for name, waiver in limits.waived.items()]


def _diagnosis(spec: GateSpec, judged: Judged) -> str:
    """The first unmet criterion in order of diagnosis, and where to look."""
    decided = first_unmet(judged.answers, judged.verdict)
    if decided is None:
        lacking = "No criterion decided: criteria, limits, the task's identity or a record lack."
        return "" if judged.verdict == "PASS" else lacking
    of = f" of {decided.candidate}" if decided.candidate else ""
    undecided = _undecided(decided)
    said = undecided or decided.caveat
    why = f" ({said})" if said and (decided.measured is None or undecided) else ""
    look_at = next(item.look_at for item in spec.criteria if item.id == decided.id)
    look_at = f"If it turns out to be broken: {look_at}" if undecided else look_at
    return f"First unmet: {decided.id}{of}{why}. {look_at}"


def _undecided(answer: Answer) -> str:
    """What would decide, where the limit lies inside the interval: the last of what is said."""
    inside = answer.verdict == "INCONCLUSIVE" and None not in (answer.measured, answer.threshold)
    return answer.caveat.rpartition("; ")[2] if inside else ""


def _decision(spec: GateSpec) -> Callable[[Judged], Decision]:
    texts: Mapping[Verdict, str] = {
        "PASS": spec.go_on,
        "PENDING_REVIEW": "Wait for the independent reviewer and the four owners.",
        "FAIL": f"Return to {spec.back_to}.",
    }
    return lambda judged: Decision(texts.get(judged.verdict) or no_decision(judged.answers))


def upstream_hashes(root: Path, gate: Gate) -> dict[str, str]:
    """SHA-256 of the reports below `gate`, by gate; those that are missing are left out."""
    found: dict[str, str] = {}
    for below in GATES[: GATES.index(gate)]:
        path = root / report_path(below)
        if path.is_file():
            found[below] = sha256_file(path)
    return found


def promoted_below(root: Path, below: Gate, wanted: Sequence[str]) -> tuple[list[str], list[str]]:
    """The wanted methods that passed the gate below, and why the others do not stand.

    Gate A judges no method, so all of them stand behind it. A report that is missing or unreadable
    is a caveat, and lets no method stand; admission proves the report.
    """
    try:
        report = parse_report(sha256_bytes_of(root / report_path(below), keep=True)[1], gate=below)
    except IntegrityError:
        passed = list(wanted) if below == "A" else []
        return passed, [f"Gate {below} has no readable report, so nothing stands on it."]
    if below == "A":
        return list(wanted), []
    passed = [name for name in wanted if report.candidates.get(name) == "PASS"]
    left_out = [
        f"{name} does not stand here: gate {below} says {report.candidates.get(name, 'nothing')}."
        for name in wanted
        if name not in passed
    ]
    return passed, left_out
