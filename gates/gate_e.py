"""Gate E, trial card: has an independent person read all this and signed for it?

Without a signed card the verdict is PENDING_REVIEW. Only people's signatures lead to PASS.
"""

import datetime
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import Field

from gates.admission import prove_chain
from gates.card import (
    DRAFT_PATH,
    Envelope,
    TrialCard,
    envelope_violations,
    missing_fields,
    promoted,
    read_card,
    validity,
)
from gates.engine import Case, CriterionSpec, GateSpec, Measured, judge_gate
from gates.evidence import Evidence, MissingEvidenceError
from gates.models import OWNERS, Comparison, GateReport, Point, StrictModel, Threshold
from gates.signing import (
    ALLOW_LIST,
    CARDS,
    SignedCard,
    conflicting_cards,
    independence,
    load_allow_list,
    open_envelope,
    utc_today,
)
from genpolicy.errors import BadInputError, GenpolicyError
from genpolicy.integrity.hashing import sha256_bytes_of

IDENTITY = "artifacts/reload/identity.json"


class Params(StrictModel):
    """Settings of Gate E other than thresholds.

    Attributes:
        card: Name of the signed card: `cards/<card>.dsse.json`.
        workspace_lower_m: Lower corner of the simulated workspace, base frame. Shape (3,).
        workspace_upper_m: Upper corner. Shape (3,).
        speed_limit_m_s: Simulated speed limit of the tool.
        maximum_days: Longest validity of a card.
    """

    card: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,63}$")
    workspace_lower_m: Point
    workspace_upper_m: Point
    speed_limit_m_s: float = Field(gt=0.0)
    maximum_days: int = Field(default=30, gt=0)

    @property
    def envelope(self) -> Envelope:
        """What was simulated."""
        return Envelope(
            workspace_lower_m=self.workspace_lower_m,
            workspace_upper_m=self.workspace_upper_m,
            speed_limit_m_s=self.speed_limit_m_s,
            maximum_days=self.maximum_days,
        )


@dataclass(frozen=True)
class Dossier:
    """What Gate E found before it asks its questions.

    Attributes:
        chain_error: Why gates A to D, or the draft, do not hold; empty if they do.
        draft: The draft card, if it can be read.
        present: Whether an envelope lies in `cards/`.
        signed: The verified card; None if there is none or it is refused.
        refusal: Why the envelope is refused; empty if it is not.
        today: Day of the judgement, UTC.
    """

    chain_error: str
    draft: TrialCard | None
    present: bool
    signed: SignedCard | None
    refusal: str
    today: datetime.date


def judge(
    root: Path,
    thresholds: Mapping[str, Threshold],
    params: Params,
    *,
    today: datetime.date | None = None,
) -> GateReport:
    """Report of Gate E from the chain and the card below `root`.

    Args:
        root: Repository root.
        thresholds: Limits by criterion.
        params: Other settings.
        today: Day of the judgement; today (UTC) if not given.

    Raises:
        ConfigError: A threshold of no criterion, or a malformed allow-list.
        IntegrityError: A file of the chain that is not what it claims to be.
    """
    evidence = Evidence(root)
    dossier = examine(root, params, today=today or utc_today())
    if (root / DRAFT_PATH).is_file():
        evidence.bind(DRAFT_PATH)
    return judge_gate(SPEC, evidence, thresholds, params, extra={"dossier": dossier})


def examine(root: Path, params: Params, *, today: datetime.date) -> Dossier:
    """Prove the chain, read the draft and verify the envelope, if there is one."""
    draft = _draft(root)
    path = root / CARDS / f"{params.card}.dsse.json"
    present = path.exists() or path.is_symlink()
    signed, refusal = None, ""
    if present:
        try:
            others = conflicting_cards(root, params.card)
            if others:
                raise BadInputError(
                    where=CARDS,
                    found=f"holding {', '.join(others)} as well",
                    expected="one card",
                    action="Retire the others.",
                )
            data = sha256_bytes_of(path, keep=True)[1]
            allowed = load_allow_list(root)
            signed = open_envelope(root, data, where=path.name, allowed=allowed)
            if signed.card.name != params.card:
                signed, refusal = None, "the card has another name than its file"
        except GenpolicyError as error:
            signed, refusal = None, str(error)
    return Dossier(_chain_error(root, draft), draft, present, signed, refusal, today)


def _draft(root: Path) -> TrialCard | None:
    try:
        data = sha256_bytes_of(root / DRAFT_PATH, keep=True)[1]
        return read_card(data, where=DRAFT_PATH)
    except BadInputError:
        return None


def _chain_error(root: Path, draft: TrialCard | None) -> str:
    try:
        reports, hashes = prove_chain(root, "D")
        candidate = promoted(reports["D"])
    except GenpolicyError as error:
        return str(error)
    if draft is None:
        return f"{DRAFT_PATH} is missing or malformed"
    try:
        entry = Evidence(root).document(IDENTITY).get(candidate)
    except (MissingEvidenceError, GenpolicyError) as error:
        return str(error)
    pinned = entry.get("checkpoint") if isinstance(entry, dict) else None
    if draft.reports != hashes:
        return "the draft names other reports than lie here; run `dvc repro card`"
    if draft.candidate != candidate or draft.candidate_checkpoint_sha256 != pinned:
        return "the draft is for another candidate than gate D promotes; run `dvc repro card`"
    return ""


def _dossier(case: Case) -> Dossier:
    found: Dossier = case.extra["dossier"]
    return found


def _waiting(what: str) -> Measured:
    return Measured(None, caveat=f"waits for a person: {what}", pending=True)


def _signed(case: Case, what: str) -> SignedCard | Measured:
    dossier = _dossier(case)
    if dossier.signed is not None:
        return dossier.signed
    if dossier.present:
        return Measured(0.0, caveat=f"the card is refused: {dossier.refusal}")
    return _waiting(what)


def _upstream_passed(case: Case) -> Measured:
    error = _dossier(case).chain_error
    return Measured(float(not error), caveat=error or "gates A to D proved again: PASS")


def _draft_complete(case: Case) -> Measured:
    dossier = _dossier(case)
    if dossier.signed is not None:
        missing = missing_fields(dossier.signed.card)
        return Measured(float(len(missing)), caveat=_listed(missing))
    if dossier.draft is None:
        raise MissingEvidenceError(f"{DRAFT_PATH} is missing or malformed")
    missing = missing_fields(dossier.draft)
    text = f"to be filled by the reviewer: {_listed(missing)}"
    return Measured(float(len(missing)), caveat=text, pending=not dossier.present)


def _listed(missing: list[str]) -> str:
    return ", ".join(missing) or "no field is empty"


def _envelope_within_limits(case: Case) -> Measured:
    found = _signed(case, "complete the envelope")
    if isinstance(found, Measured):
        return found if found.pending else Measured(None, caveat=found.caveat)
    draft = _dossier(case).draft
    if draft is None:
        raise MissingEvidenceError(f"{DRAFT_PATH} is missing or malformed")
    bad = envelope_violations(found.card, draft, case.params.envelope)
    return Measured(float(len(bad)), caveat=", ".join(bad) or "inside what was simulated")


def _signature_valid(case: Case) -> Measured:
    found = _signed(case, "sign the card")
    if isinstance(found, Measured):
        return found
    names = ", ".join(f"{p.name} ({p.role})" for p in found.signers)
    return Measured(1.0, caveat=f"signed by {names}, over this chain")


def _reviewer_independent(case: Case) -> Measured:
    found = _signed(case, "review by someone who is not the author")
    if isinstance(found, Measured):
        return found
    independent, text = independence(found)
    return Measured(float(independent), caveat=text)


def _owners_signed(case: Case) -> Measured:
    found = _signed(case, "sign-off by model, perception, controller and safety owner")
    if isinstance(found, Measured):
        return found
    roles = {person.role for person in found.signers} & set(OWNERS)
    missing = [role for role in OWNERS if role not in roles]
    return Measured(float(len(roles)), caveat=f"missing: {', '.join(missing)}" if missing else "")


def _not_expired(case: Case) -> Measured:
    found = _signed(case, "give the days of validity")
    if isinstance(found, Measured):
        return found
    dossier = _dossier(case)
    valid, text = validity(found.card, today=dossier.today, maximum_days=case.params.maximum_days)
    return Measured(float(valid), caveat=text)


def _card_spec(
    name: str,
    question: str,
    comparison: Comparison,
    measure: Callable[[Case], Measured],
    look_at: str,
) -> CriterionSpec:
    return CriterionSpec(
        id=name,
        question=question,
        comparison=comparison,
        owner="safety",
        evidence=(DRAFT_PATH,) if name == "draft_complete" else (),
        measure=measure,
        look_at=look_at,
    )


SPEC = GateSpec(
    gate="E",
    bind=(f"{CARDS}/*.dsse.json", ALLOW_LIST, "reports/gate_[a-d].json"),
    back_to="the reviewer",
    go_on="The card is valid. What happens on hardware is outside this project.",
    caveats=(
        "A signature says who answers for the card; it does not make the trial safe.",
        "One person under two names on the allow-list is not detected; review that file.",
        "Revocation is by removing a key from the allow-list and judging again.",
    ),
    criteria=(
        _card_spec(
            "upstream_passed",
            "Do gates A to D still hold, proved again from the bytes?",
            ">=",
            _upstream_passed,
            "Something below has changed; start at the first gate that refuses.",
        ),
        _card_spec(
            "draft_complete",
            "How many fields of the card are empty?",
            "<=",
            _draft_complete,
            "The reviewer completes the draft; a force limit is measured, never assumed.",
        ),
        _card_spec(
            "signature_valid",
            "Do valid signatures cover this very chain?",
            ">=",
            _signature_valid,
            "Sign the current draft; a card for other bytes, robots or candidates is void.",
        ),
        _card_spec(
            "reviewer_independent",
            "Is the reviewer someone other than the author?",
            ">=",
            _reviewer_independent,
            "Find a reviewer who did not make the candidate.",
        ),
        _card_spec(
            "owners_signed",
            "How many of the four owners signed off?",
            ">=",
            _owners_signed,
            "Model, perception, controller and safety each answer for their part.",
        ),
        _card_spec(
            "envelope_within_limits",
            "How many limits are looser than what was simulated?",
            "<=",
            _envelope_within_limits,
            "Tighten the card; what was not simulated is not allowed.",
        ),
        _card_spec(
            "not_expired",
            "Is the card valid today?",
            ">=",
            _not_expired,
            "The card is not yet or no longer valid; review again.",
        ),
    ),
)
