"""Data semantics: is what was recorded what it claims to be, before anything is made of it?"""

from gates.cause import Topic
from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError, numbers
from gates.need.cause import as_the_cause, found_cause, waived_questions
from gates.need.settings import AUDIT, NeedSettings
from gates.need.waivers import require_questions
from genpolicy.audit.rows import Asked, Calibration, Clock
from genpolicy.evidence.documents.given import REFUSALS

INGEST = "artifacts/ingest"


@criterion(
    "<=",
    question="Is every recording either accepted or refused by name?",
    look_at="Data semantics: a recording vanished at ingest; read the refusals.",
)
def refused_recordings_accounted(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Recordings that ingest neither accepted nor refused: |accepted + refused - found|."""
    document = evidence.document(INGEST, REFUSALS)
    found, accepted, refused = document.found, document.accepted, len(document.refused)
    if found == 0:
        raise MissingEvidenceError("no recordings were found")
    text = f"{found} found, {accepted} accepted, {refused} refused"
    left = float(abs(accepted + refused - found))
    return Measured(left, caveat=text, counted=f"all {found} recordings")


@criterion(
    "<=",
    question="Was every question asked of the data, or waived by name?",
    look_at="Data semantics: record or declare what is missing, or let its owner waive it by name.",
    always=True,
)
def unasked_checks(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Questions that could not be asked and that nobody waived; with any, nothing can be said."""
    frame = evidence.rows(f"{AUDIT}/asked.parquet", Asked)
    answered = {check for checks in settings.waived_checks.values() for check in checks}
    require_questions(answered - set(frame["check"]), evidence)
    silent = frame[~frame["asked"].astype(bool)]
    left = silent[~silent["check"].isin(answered)]
    idle = ", ".join(sorted(answered - set(silent["check"])))
    remark = f"; waived without need here: {idle}" if idle else ""
    if len(left) == 0:
        waived = f", {len(silent)} of them waived" if len(silent) else ""
        text = f"{len(frame)} questions{waived}{remark}"
        return Measured(0.0, caveat=text, counted=f"all {len(frame)} questions")
    rows = zip(left["check"], left["reason"], strict=True)
    text = "; ".join(f"{check} ({reason})" for check, reason in rows)
    return Measured(None, caveat=f"not asked: {text}{remark}")


@criterion(
    "<=",
    question="Do the clocks of all streams agree?",
    look_at="Data semantics: recheck timestamps per stream and epoch before anything else.",
)
def clock_residual_s(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Largest clock offset that stands out; else the largest left after realignment, s."""
    clocks = evidence.rows(f"{AUDIT}/clocks.parquet", Clock)
    of = f"all {len(clocks)} clocks, one a stream and epoch"
    return as_the_cause("clock_residual_s", evidence, settings, of=of)


@criterion(
    "<=",
    question="Is the lag from action to state the same in every epoch?",
    look_at="Data semantics: actions and states are shifted against each other in some epochs.",
)
def lag_spread_rows(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Largest spread over epochs of the lag of one stream, action steps."""
    frame = evidence.rows(f"{AUDIT}/clocks.parquet", Clock)
    lags = frame.assign(lag_rows=numbers(frame, "lag_rows")).groupby("stream")["lag_rows"]
    return Measured(float((lags.max() - lags.min()).max()), caveat="largest over streams")


@criterion(
    "<=",
    question="Are the calibration epochs consistent?",
    look_at="Data semantics: an epoch's frames drifted; recalibrate or exclude it by name.",
)
def calibration_residual_m(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Largest calibration residual over epochs, m."""
    epochs = evidence.rows(f"{AUDIT}/calibration.parquet", Calibration)
    of = f"all {len(epochs)} calibration epochs"
    return as_the_cause("calibration_residual_m", evidence, settings, of=of)


@criterion(
    "<=",
    question="Do outcome labels agree with replay?",
    look_at="Data semantics: failed episodes are labelled successful; correct labels first.",
)
def label_disagreement(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Upper exact bound of the share of labels that replay contradicts."""
    return as_the_cause("label_disagreement", evidence, settings)


@criterion(
    "<=",
    question="Do units, frames, columns, copies, boundaries and labels mean what they say?",
    look_at="Data semantics: the recordings are not what they claim; repair them, count again.",
    always=True,
)
def data_defects(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Questions to the data whose number is beyond its limit, those of the cause.

    Units, frames, swapped columns, copied and glued recordings, clocks and labels are asked once,
    by the cause; its limits hold here as well, whatever the modes look like.
    """
    cause = found_cause(evidence, settings)
    asked = [answer for answer in cause.answers if answer.topic in (Topic.DATA, Topic.LABELS)]
    red = [
        f"{answer.what} {answer.measured:.4g}{f' {answer.unit}' if answer.unit else ''}"
        f"{f' ({answer.note})' if answer.note else ''}, limit {answer.limit:.4g}"
        for answer in asked
        if answer.red
    ]
    text = "; ".join(red) or f"none of {len(asked)} numbers is beyond its limit"
    asked_here = {answer.question for answer in asked}
    for name in sorted(asked_here & set(waived_questions(settings.limits))):
        text += f"; {name} is waived, and asked here by the packaged limit"
    return Measured(float(len(red)), caveat=text, counted=f"all {len(asked)} numbers")
