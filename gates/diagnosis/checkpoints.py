"""The chapter's nine checkpoint rows as rules: criteria that carry each, and the owner who answers.

Every criterion of every gate carries a row, so that none is judged without a reader for it.
"""

from dataclasses import dataclass

from gates.diagnosis.reports import Reports, gate_and_id
from gates.report import Answer, Owner, Verdict
from gates.verdicts import best, combine, worst

NOT_JUDGED = "NOT JUDGED"
UNMATCHED = "UNMATCHED"
"""In place of PASS of a row that asks of matching what nobody asked of the candidate."""


@dataclass(frozen=True)
class Checkpoint:
    """One row.

    Attributes:
        area: Its name.
        owner: Who answers for the row; the limits of its criteria may be others' as well.
        decision: What is decided.
        artifact: What is handed in.
        reject_when: What forbids promotion.
        criteria: What carries the row, by gate and name.
    """

    area: str
    owner: Owner
    decision: str
    artifact: str
    reject_when: str
    criteria: tuple[str, ...]


@dataclass(frozen=True)
class Ruled:
    """A row, held against the reports that lie here.

    Attributes:
        area: Its name.
        owner: Who answers for it.
        reject_when: What forbids promotion.
        verdict: Of its criteria together: every one must hold, and of candidates one must hold in
            all. `NOT JUDGED` where it would pass and one of its gates is not judged, `UNMATCHED`
            where it would pass and only who was excepted from matching holds in all.
        candidates: Verdict of each that every judged gate of the row asked, by its own criteria.
        unmet: Criteria that do not hold, by gate, name and candidate.
        waits_for: Why some have no answer.
        not_asked: What was waived or excepted, by whose word and why.
        criteria: What carries the row.
        limits_of: Owners of the limits of those that were answered.
    """

    area: str
    owner: str
    reject_when: str
    verdict: str
    candidates: dict[str, str]
    unmet: tuple[str, ...]
    waits_for: tuple[str, ...]
    not_asked: tuple[str, ...]
    criteria: tuple[str, ...]
    limits_of: tuple[str, ...]


def _of(gate: str, names: str) -> tuple[str, ...]:
    return tuple(f"{gate}.{name}" for name in names.split())


CHECKPOINTS = (
    Checkpoint(
        "need", "perception", "valid modes or recovery hypothesis", "multimodality audit",
        "hidden state or data defect explains it",
        _of("A", "refused_recordings_accounted unasked_checks clock_residual_s lag_spread_rows "
            "calibration_residual_m label_disagreement data_defects held_out_situations "
            "multimodal_situations persistence_margin mode_success_lower mode_feasible_share "
            "mean_defeated_share strata_effect told_share cause_accepted phase_collapse_share"),
    ),
    Checkpoint(
        "target", "model", "mapped action and horizons", "action contract",
        "semantics differ by method",
        (*_of("A", "baselines_matched"),
         *_of("B", "unmatched_keys metadata_mismatches conformance")),
    ),
    Checkpoint(
        "model", "model", "BC/ACT/diffusion/flow delta", "matched config matrix",
        "encoder, data, or resets unfair",
        (*_of("A", "baselines_matched factors_isolated chunking_valid_share remedy_valid_share "
              "latent_dependence_p factor_valid_share baseline_mode_coverage"),
         *_of("B", "unmatched_keys parameter_budget_deviation late_change_upper "
              "baseline_fall_upper"),
         *_of("D", "unmatched_starts")),
    ),
    Checkpoint(
        "sampling", "model", "schedule, solver, NFE, seed", "versioned sampler log",
        "only microbenchmark evidence",
        (*_of("B", "unpinned_items nonfinite_weights samples_difference varied_difference "
              "nfe_mismatch mode_coverage_lower outside_modes_upper"),
         *_of("D", "nominal_success_lower stress_success_lower latency_p95_s")),
    ),
    Checkpoint(
        "timing", "controller", "full latency and action age", "trace and queue report",
        "p95 deadline/freshness violated",
        (*_of("B", "latency_terms_missing warm_latency_ratio_upper cold_latency_ratio_upper "
              "latency_model_ratio_upper"),
         *_of("C", "stub_stale boundary_jerk_p95_m_s3 conservation_error"),
         *_of("D", "deadline_miss_upper latency_p95_s hold_share_upper conservation_error")),
    ),
    Checkpoint(
        "feasibility", "controller", "representation→contact gates",
        "rejection/projection report", "invalid sample reaches stub",
        (*_of("C", "mode_admissible_gap admissible_share projection_p95_m corrupted_refused_share "
              "stub_invalid stub_violation_upper"),
         *_of("D", "rejection_share_upper stub_violations")),
    ),
    Checkpoint(
        "recovery", "safety", "hold, retreat, fallback, human", "state-machine test",
        "resampling is the only recovery",
        (*_of("C", "incidents_miscounted"),
         *_of("D", "recovery_success_lower fallback_share_upper intervention_upper reset_upper")),
    ),
    Checkpoint(
        "evidence", "model", "source-specific conditions", "caveat ledger",
        "unmatched results create ranking",
        (*_of("A", "baselines_matched"), *_of("B", "unmatched_keys"),
         *_of("D", "unmatched_starts verdict_reachable promotion_e_value")),
    ),
    Checkpoint(
        "safety", "safety", "independent supervisor", "reviewed trial card",
        "learned score owns safety",
        (*_of("C", "changed_answers checker_violations mutants_undetected"),
         *_of("D", "changed_answers force_peak_p95_n stub_violations checker_violations"),
         *_of("E", "upstream_passed draft_complete signature_valid reviewer_independent "
              "owners_signed envelope_within_limits not_expired")),
    ),
)  # fmt: skip
"""In the chapter's order; `decision`, `artifact` and `reject_when` in its words."""


def ruled(reports: Reports) -> list[Ruled]:
    """Every row by the reports that lie here."""
    return [_ruled(row, reports) for row in CHECKPOINTS]


def _ruled(row: Checkpoint, reports: Reports) -> Ruled:
    answers: list[tuple[str, Answer]] = []
    waits: dict[str, None] = {}
    for name in row.criteria:
        gate, wanted = gate_and_id(name)
        if gate not in reports.judged:
            waits[reports.missing[gate]] = None
            continue
        found = [c for c in reports.judged[gate].criteria if c.id == wanted]
        answers += [(name, answer) for answer in found]
    stand = _who_stands(row, reports)
    counting = [a for _, a in answers if a.candidate is None or a.candidate in stand]
    excepted = {name for name in stand if _is_excepted(row, reports, name)}
    verdict, candidates = _combined(counting, excepted, any(a.candidate for _, a in answers))
    named = {
        name: UNMATCHED if said == "PASS" and name in excepted else str(said)
        for name, said in candidates.items()
    }
    passes = "PASS" in named.values() or not named
    said = UNMATCHED if verdict == "PASS" and not passes else str(verdict)
    unmet = tuple(_named(name, a) for name, a in answers if a.verdict != "PASS")
    return Ruled(
        area=row.area,
        owner=row.owner,
        reject_when=row.reject_when,
        verdict=NOT_JUDGED if waits and (verdict == "PASS" or not unmet) else said,
        candidates=named,
        unmet=unmet,
        waits_for=tuple(waits),
        not_asked=_not_asked(row, reports),
        criteria=row.criteria,
        limits_of=tuple(dict.fromkeys(str(a.owner) for _, a in answers if a.owner)),
    )


def _who_stands(row: Checkpoint, reports: Reports) -> set[str]:
    """Candidates that every judged gate of the row has answers of.

    One that was stopped below a gate has not been asked there, and must not pass by that.
    """
    gates = {gate_and_id(name)[0] for name in row.criteria} & set(reports.judged)
    groups = [set(reports.judged[gate].candidates) for gate in gates]
    named = [group for group in groups if group]
    return set.intersection(*named) if named else set()


def _combined(
    answers: list[Answer], excepted: set[str], asked_of_each: bool
) -> tuple[Verdict, dict[str, Verdict]]:
    """Verdict of a row and of each candidate, those included of whom all of it was excepted."""
    common = [a.verdict for a in answers if a.candidate is None]
    candidates = combine(answers, expects_candidates=False)[1]
    candidates |= {name: "PASS" for name in sorted(excepted - set(candidates))}
    of_one = [best(candidates.values())] if asked_of_each or candidates else []
    return worst([*common, *of_one]), candidates


def _is_excepted(row: Checkpoint, reports: Reports, candidate: str) -> bool:
    return any(reports.is_excepted(name, candidate) for name in row.criteria)


def _not_asked(row: Checkpoint, reports: Reports) -> tuple[str, ...]:
    texts = (
        text
        for name in row.criteria
        for candidate in reports.candidates
        for text in reports.not_asked(name, candidate)
    )
    return tuple(dict.fromkeys(texts))


def _named(name: str, answer: Answer) -> str:
    of = f" ({answer.candidate})" if answer.candidate else ""
    return f"{name}{of} {answer.verdict}"
