"""The cause behind the modes: named from the audit's numbers, under the limits of this gate."""

from gates.cause import (
    Answer,
    Cause,
    CauseLimits,
    deciding_answer,
    default_limits,
    limits_of,
    name_cause,
    read_measured,
    read_numbers,
)
from gates.cause.limits import SHARED
from gates.cause.naming import IN_METRES
from gates.cause.reading import Documents, Rows
from gates.criterion import Measured
from gates.evidence import Evidence, MissingEvidenceError
from gates.need.settings import AUDIT, NeedSettings
from gates.recount import Differs, Subset, is_one
from gates.report import Recount
from gates.settings import PARAMS_FILE, Limit, Limits, Waiver
from genpolicy.audit.rows import ModeOutcome, ReplayRow
from genpolicy.documents.document import Content, Document
from genpolicy.errors import BadInputError

PLACE = f"{PARAMS_FILE}: gate_a.cause"
MODES, REPLAYED = f"{AUDIT}/modes.parquet", f"{AUDIT}/replay.parquet"
DISAGREE = Differs("label", "replayed")
"""Of a replayed episode: its label says otherwise."""
OF_A_MODE = {
    "mode_success_lower": (("successes",), "episodes"),
    "mode_feasible_share": (("admissible",), "checked"),
}
"""Columns that a number of one mode is a share of."""


def found_cause(evidence: Evidence, settings: NeedSettings) -> Cause:
    """The cause that the audit's numbers name under the limits of this gate.

    Four criteria ask for it; all resampled audits are read and named once.

    Raises:
        MissingEvidenceError: Numbers, or limits of shared questions, are missing.
        ConfigError: A limit lies below what the audit looked for, or a question has none.
    """
    limits = _limits(settings)
    key = ("cause", limits.confidence, *limits.by_question.items())
    return evidence.once(key, lambda: _named(evidence, limits))


def _named(evidence: Evidence, limits: CauseLimits) -> Cause:
    try:
        numbers, draws = read_numbers(*_readers(evidence))
    except BadInputError as error:
        raise MissingEvidenceError(str(error)) from error
    return name_cause(numbers, draws, limits)


def as_the_cause(
    question: str, evidence: Evidence, settings: NeedSettings, *, also: str = "", of: str = ""
) -> Measured:
    """What the cause itself answers to a question that a criterion asks as well.

    One function, so that this gate and `genpolicy audit` cannot disagree about it.

    Args:
        question: The criterion, which is the question.
        evidence: What the audit wrote.
        settings: Limits and confidence.
        also: What the criterion shows beside it.
        of: What it was asked of, where the answer counts no units.

    Raises:
        MissingEvidenceError: As `found_cause`; or nothing, or nothing known, stands to the limit.
        ConfigError: As `found_cause`.
    """
    limits = _limits(settings)
    try:
        numbers = read_measured(*_readers(evidence))
    except BadInputError as error:
        raise MissingEvidenceError(str(error)) from error
    answer = deciding_answer(question, numbers, limits)
    if answer is None:
        raise MissingEvidenceError(f"the audit holds no number to the limit of {question}")
    if answer.measured is None:
        raise MissingEvidenceError(f"{answer.what}: {answer.note}")
    unit = numbers.metre if question in IN_METRES else 1.0
    text = "; ".join(filter(None, [answer.what, answer.note, also]))
    interval = answer.interval and (answer.interval[0] / unit, answer.interval[1] / unit)
    return Measured(
        answer.measured / unit,
        interval,
        text,
        counted=answer.counted or of,
        recount=_recount(answer, evidence),
    )


def _recount(answer: Answer, evidence: Evidence) -> Recount | None:
    """Where the number of one mode, or of the labels, is counted again."""
    if answer.question == "label_disagreement":
        return Subset(REPLAYED).counted(evidence.rows(REPLAYED, ReplayRow), DISAGREE)
    if not answer.mode:
        return None
    subset = Subset(MODES, (is_one("mode", answer.mode),))
    rows = subset.of(evidence.rows(MODES, ModeOutcome))
    if len(rows) != 1:  # another phase has a mode of the same name
        return None
    return subset.summed(rows, *OF_A_MODE[answer.question])


def _limits(settings: NeedSettings) -> CauseLimits:
    shared = asked(settings.limits)
    absent = [question for question in SHARED if question not in shared]
    if absent:
        raise MissingEvidenceError(f"params.yaml: gate_a has no limit of {', '.join(absent)}")
    return limits_of(settings.cause, shared, confidence=settings.confidence, where=PLACE)


def _readers(evidence: Evidence) -> tuple[Documents, Rows]:
    def document(kind: Document[Content]) -> Content:
        return evidence.document(AUDIT, kind)

    return document, lambda name, row: evidence.records(f"{AUDIT}/{name}", row)


def asked(limits: Limits) -> dict[str, Limit]:
    """Limits of the gate; a question whose criterion is waived keeps the packaged one.

    A waiver says that a criterion need not be asked here. It cannot say that what the audit did
    measure is in order: where it measured nothing, no limit turns anything red.
    """
    packaged = default_limits()
    kept = {
        name: Limit(packaged[name], f"packaged, since waived: {waiver.reason}", waiver.owner)
        for name, waiver in waived_questions(limits).items()
    }
    return {**kept, **limits.of}


def waived_questions(limits: Limits) -> dict[str, Waiver]:
    """Criteria that are declared not applicable, of those that the cause asks as well."""
    return {name: waiver for name, waiver in limits.waived.items() if name in SHARED}
