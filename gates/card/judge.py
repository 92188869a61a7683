"""Gate E, trial card: has an independent person read all this and signed for it?

Without a signed card the verdict is PENDING_REVIEW. Only people's signatures lead to PASS.
"""

import datetime
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field

from gates.card.card import (
    DRAFT_PATH,
    CardName,
    TrialCard,
    caveats_of,
    envelope_violations,
    left_out,
    missing_fields,
    promoted,
    thresholds_of,
    validity,
)
from gates.card.envelope import ENVELOPE_FILE, simulated_envelope, was_judged
from gates.card.papers import Papers, examine
from gates.card.people import ALLOW_LIST, SIGNERS, load_allow_list
from gates.card.rollback import require_rollback
from gates.card.searched import SEARCHED, searched_caveats
from gates.card.signing import (
    CARDS,
    SignedCard,
    envelope_path,
    independence,
)
from gates.card.windows import require_aborts, windows_of
from gates.criterion import Measured, criteria_of, criterion
from gates.engine import Decision, GateSpec, judge, recorded_evidence
from gates.evidence import Evidence, MissingEvidenceError
from gates.exceptions import unmatched_written, utc_today
from gates.overriders import first_end, require_in_force
from gates.overrides import OVERRIDES, Exceptions, exceptions_of
from gates.pipeline import check_record
from gates.preregistration import PREREGISTRATION, moved_caveats
from gates.protection import is_rehearsal, require_protection
from gates.report import OWNERS, Gate, GateReport, stage_of
from gates.reproducibility.settings import RELOAD
from gates.running import require_running_code
from gates.settings import GateSettings, read_limits, read_params, read_settings
from gates.stress.contact import untouched
from genpolicy.errors import GenpolicyError, IntegrityError
from genpolicy.evidence.documents.reproducibility import CANDIDATES

NOBODY_SIGNS = Decision("Wait for nobody: no card of a rehearsal can be signed.")


class CardGateSettings(GateSettings):
    """Settings of Gate E other than limits.

    Attributes:
        card: Name of the signed card: `cards/<card>.dsse.json`.
        maximum_days: Longest validity of a card.
    """

    homes: ClassVar[Mapping[str, str]] = {"card": "card.name"}

    card: CardName
    maximum_days: int = Field(gt=0)


@dataclass(frozen=True)
class Chain:
    """Gates A to D as proved: their reports and SHA-256, or why they do not hold."""

    reports: Mapping[Gate, GateReport]
    hashes: Mapping[Gate, str]
    error: str = ""


@dataclass(frozen=True)
class Dossier:
    """What Gate E knows before it asks its questions.

    Attributes:
        settings: Section `gate_e`.
        papers: The draft and the envelope.
        chain_error: Why gates A to D, or the draft, do not hold; empty if they do.
        today: Day of the judgement, UTC.
        excepted_until: Last day of the exceptions by which the candidate stands, the first that
            ends; empty without one.
    """

    settings: CardGateSettings
    papers: Papers
    chain_error: str
    today: datetime.date
    excepted_until: str = ""


def judge_card(root: Path, chain: Chain, *, today: datetime.date | None = None) -> GateReport:
    """Report of Gate E from the chain and the card below `root`.

    Args:
        root: Repository root.
        chain: Gates A to D, proved just now.
        today: Day of the judgement; today (UTC) if not given.

    Raises:
        ConfigError: The section is missing or wrong, or a malformed allow-list.
        IntegrityError: A file of the chain that is not what it claims to be.
    """
    params = read_params(root)
    settings = read_settings(params, stage_of("E"), CardGateSettings)
    caveats = (*require_protection(params, "E"), *moved_caveats(root, params, "E"))
    papers = examine(root, settings.card)
    exceptions = exceptions_of(root, params, "E")
    day = today or utc_today()
    error = chain.error or _chain_error(root, chain, papers.draft, day)
    until = _until(params, papers.draft, exceptions)
    dossier = Dossier(settings, papers, error, day, until)
    limits = read_limits(params, "E", GATE.criteria)
    evidence = recorded_evidence(root, "E")
    spec = replace(GATE, decide=lambda _: NOBODY_SIGNS) if is_rehearsal(params) else GATE
    report = judge(
        spec, evidence, limits, settings, given=dossier, caveats=caveats, exceptions=exceptions
    )
    check_record(root, "E", report.materials)
    require_running_code(root)
    return report


def _until(params: Mapping[str, Any], draft: TrialCard | None, exceptions: Exceptions) -> str:
    """The day on which the first exception ends, of matching or of a limit; empty without one."""
    if draft is None:
        return ""
    name = draft.candidate
    own = unmatched_written(params).get(name)
    days = own.expires if own else "", first_end(exceptions.below, name)
    return min(filter(None, days), default="")


def _chain_error(root: Path, chain: Chain, draft: TrialCard | None, day: datetime.date) -> str:
    try:
        require_in_force(root, chain.reports, day)
        candidate = promoted(chain.reports["D"])
        if draft is None:
            return f"{DRAFT_PATH} is missing or malformed"
        simulated = simulated_envelope(Evidence(root))
        if not was_judged(chain.reports["D"], simulated.condition):
            return f"gate D did not judge the condition {simulated.condition!r} of the card"
        entry = Evidence(root).document(RELOAD, CANDIDATES).get(candidate)
        require_rollback(draft.rollback, chain.reports, Evidence(root))
        thresholds = thresholds_of(chain.reports["D"])
        windows = windows_of(Evidence(root), candidate, simulated.condition, thresholds)
        require_aborts(draft.abort_thresholds, draft.abort_windows, thresholds, windows)
        required = [*caveats_of(chain.reports), *searched_caveats(root, candidate)]
    except (MissingEvidenceError, GenpolicyError) as error:
        return str(error)
    pinned = entry.checkpoint if entry else None
    if draft.reports != chain.hashes:
        return "the draft names other reports than lie here; run `dvc repro card`"
    if draft.candidate != candidate or draft.candidate_checkpoint_sha256 != pinned:
        return "the draft is for another candidate than gate D promotes; run `dvc repro card`"
    lacking = "".join(left_out(required, draft)[:1])
    return lacking and f"the draft leaves out a caveat ({lacking[:60]!r}); run `dvc repro card`"


def _waiting(what: str) -> Measured:
    return Measured(None, caveat=f"waits for a person: {what}", pending=True)


def _signed(evidence: Evidence, dossier: Dossier, what: str) -> SignedCard | Measured:
    """The card that people signed, or what is said where there is none; its papers are read."""
    papers = dossier.papers
    for path in (envelope_path(dossier.settings.card), ALLOW_LIST):
        evidence.digest(path)
    if papers.signed is not None:
        return papers.signed
    if papers.present:
        return Measured(0.0, caveat=f"the card is refused: {papers.refusal}")
    return _waiting(what)


def _draft_of(papers: Papers) -> TrialCard:
    if papers.draft is None:
        raise MissingEvidenceError(f"{DRAFT_PATH} is missing or malformed")
    return papers.draft


@criterion(
    ">=",
    question="Do gates A to D still hold, proved again from the bytes?",
    look_at="Something below has changed; start at the first gate that refuses.",
    always=True,
)
def upstream_passed(evidence: Evidence, dossier: Dossier) -> Measured:
    """1 if the chain below holds and the draft is of this chain, else 0."""
    error = dossier.chain_error
    return Measured(float(not error), caveat=error or "gates A to D proved again: PASS")


@criterion(
    "<=",
    question="How many fields of the card are empty?",
    look_at="The reviewer completes the draft; a force limit is measured, never assumed.",
    always=True,
)
def draft_complete(evidence: Evidence, dossier: Dossier) -> Measured:
    """Empty fields of the signed card, or of the draft while there is none."""
    evidence.digest(DRAFT_PATH)
    papers = dossier.papers
    if papers.signed is not None:
        missing = missing_fields(papers.signed.card)
        return Measured(float(len(missing)), caveat=_listed(missing))
    missing = missing_fields(_draft_of(papers))
    text = f"to be filled by the reviewer: {_listed(missing)}"
    return Measured(float(len(missing)), caveat=text, pending=not papers.present)


def _listed(missing: list[str]) -> str:
    return ", ".join(missing) or "no field is empty"


@criterion(
    ">=",
    question="Do valid signatures cover this very chain?",
    look_at="Sign the current draft; a card for other bytes, robots or candidates is void.",
    always=True,
)
def signature_valid(evidence: Evidence, dossier: Dossier) -> Measured:
    """1 if every signature verifies over this chain, else 0."""
    found = _signed(evidence, dossier, "sign the card")
    if isinstance(found, Measured):
        return found
    names = ", ".join(f"{p.id} ({p.role})" for p in found.signers)
    return Measured(1.0, caveat=f"signed by {names}, over this chain")


@criterion(
    ">=",
    question="Are reviewer, authors and spotter different people, and does no author sign?",
    look_at="Find a reviewer who did not make the candidate, and somebody else at the stop.",
    always=True,
)
def reviewer_independent(evidence: Evidence, dossier: Dossier) -> Measured:
    """1 if the named reviewer signed, no signer is an author and the spotter is neither, else 0.

    Waits where others signed first, and that reviewer can still do so.
    """
    found = _signed(evidence, dossier, "review by someone who is no author")
    if isinstance(found, Measured):
        return found
    independent, text = independence(found, load_allow_list(evidence.root))
    if independent is None:
        return _waiting(f"review and sign-off by {found.card.reviewer}")
    return Measured(float(independent), caveat=text)


@criterion(
    ">=",
    question="How many of the four owners signed off?",
    look_at="Model, perception, controller and safety each answer for their part.",
    always=True,
)
def owners_signed(evidence: Evidence, dossier: Dossier) -> Measured:
    """Owners whose signatures verified.

    Waits for the others while nobody signed out of turn, and somebody on the list still can.
    """
    found = _signed(evidence, dossier, "sign-off by model, perception, controller and safety owner")
    if isinstance(found, Measured):
        return found
    roles = {person.role for person in found.signers} & set(OWNERS)
    missing = [role for role in OWNERS if role not in roles]
    able = {
        person.role
        for person in load_allow_list(evidence.root).people
        if person.id not in found.card.authors
    }
    in_turn = {person.role for person in found.signers} <= set(SIGNERS)
    text = f"missing: {', '.join(missing)}" if missing else ""
    return Measured(float(len(roles)), caveat=text, pending=in_turn and able.issuperset(missing))


@criterion(
    "<=",
    question="How many limits are not those that the rollouts were held to?",
    look_at="Plan the card's envelope and run again; what was not simulated is not allowed.",
    always=True,
)
def envelope_within_limits(evidence: Evidence, dossier: Dossier) -> Measured:
    """Limits of the card other than simulated or looser than the draft; commands beyond them."""
    found = _signed(evidence, dossier, "complete the envelope")
    if isinstance(found, Measured):
        return found if found.pending else Measured(None, caveat=found.caveat)
    draft = _draft_of(dossier.papers)
    try:
        simulated = simulated_envelope(evidence)
    except IntegrityError as error:
        raise MissingEvidenceError(str(error)) from error
    bad = envelope_violations(found.card, draft, simulated)
    text = ", ".join(bad) or "as simulated, and no command beyond"
    if unseen := untouched(draft.caveats, draft.candidate):
        text += f"; {unseen}: the force limit stands on the written reason alone"
        text += f" ({found.card.force_limit_reason})"
    return Measured(float(len(bad)), caveat=text)


@criterion(
    ">=",
    question="Is the card valid today?",
    look_at="The card is not yet or no longer valid; review again.",
    always=True,
)
def not_expired(evidence: Evidence, dossier: Dossier) -> Measured:
    """1 if today lies in its days, they are not too many, and no exception ends before, else 0."""
    found = _signed(evidence, dossier, "give the days of validity")
    if isinstance(found, Measured):
        return found
    days = dossier.settings.maximum_days
    valid, text = validity(found.card, today=dossier.today, maximum_days=days)
    if valid and (until := dossier.excepted_until) and found.card.expires > until:
        valid, text = False, f"it outlives the exception of its candidate, which ends on {until}"
    return Measured(float(valid), caveat=text)


GATE = GateSpec(
    gate="E",
    settings=CardGateSettings,
    criteria=criteria_of(globals()),
    bind=(
        DRAFT_PATH,
        ENVELOPE_FILE,
        SEARCHED,
        PREREGISTRATION,
        OVERRIDES,
        f"{CARDS}/*.dsse.json",
        ALLOW_LIST,
        "reports/gate_[a-d].json",
    ),
    back_to="the reviewer",
    go_on="The card is valid. What happens on hardware is outside this project.",
    caveats=(
        "A signature says who answers for the card; it does not make the trial safe.",
        "One person under two keys on the allow-list is not detected; review that file.",
        "Revocation is by removing a key from the allow-list and judging again.",
    ),
)
