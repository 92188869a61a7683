"""What you sign, on the desk: each field as seen in simulation, as proposed, and as people set it.

Only what rollouts were held to is proposed: a force limit, who stands at the stop, how the robot is
stopped and for which days are left to the people who answer for them. What they were held to they
need not have reached: where the box goes further than they did, the page says so.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from gates.card.card import ABORT_FROM, DRAFT_PATH, FIXED, TrialCard, missing_fields, undrafted
from gates.card.envelope import ENVELOPE_FILE
from gates.card.papers import Papers, examine
from gates.card.people import REVIEWER, SIGNERS
from gates.card.rollback import rollback_of
from gates.engine import upstream_hashes
from gates.evidence import Evidence, MissingEvidenceError, numbers
from gates.pages.bound import require_bound
from gates.pages.desk import rehearsed
from gates.pages.numbers import at_its_end
from gates.pages.rows import Rows
from gates.protection import REHEARSED
from gates.readable import human
from gates.report import Answer, Gate, GateReport, Point
from gates.stress.rollouts import ROLLOUTS, STRESS
from gates.stress.visited import BEYOND
from gates.words import SHOWN_HASH
from genpolicy.errors import IntegrityError
from genpolicy.evidence.documents.stress import ENVELOPE
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.verification.report import Reached

NOTHING = "nothing that simulation can show"
NOT_PROPOSED = "not proposed"
ELSEWHERE = "not built here"
MISSING = "missing on the signed card"
UNSIGNED = "nothing: no card of a rehearsal can be signed"
AS_SIMULATED = "as simulated; for another one plan it and run again"
ABORTS = {
    "latency_s": "more than 5 % of answers later than",
    "deadline_miss_share": "missed deadlines above",
    "hold_share": "time it waits above",
    "rejection_share": "answers rejected whole above",
    "fallback_share": "time of the fallback above",
    "intervention_share": "runs with a person above",
    "reset_share": "runs that stop, to be reset, above",
}
"""What each abort threshold of a card ends the trial at, in words."""
WORKSPACE, SPEED, INSTEAD = "Workspace, mm", "Speed of the tool", "What runs instead"
FORCE = "Ends it: contact force above"
MM_PER_M = 1000.0


@dataclass(frozen=True)
class Item:
    """One field of the card.

    Attributes:
        field: In words.
        seen: What rollouts of the candidate did.
        proposed: By the draft; not proposed where nothing was seen that could carry it.
        yours: What people set, of a signed card; what is left to them of a draft. Empty where a
            line is to be filled.
        owner: Who answers for it.
        rows: File of the rows under what was seen, beside the first page; empty where none is.
    """

    field: str
    seen: str
    proposed: str
    yours: str
    owner: str
    rows: str = ""


@dataclass(frozen=True)
class Signing:
    """What is to be signed, or why nothing is.

    Attributes:
        items: Fields of the card.
        caveats: How many sentences the signer signs in spite of.
        signed: Who has signed, `id (role)`.
        lacking: Roles that have not.
        fields: Fields that a person has still to fill; the nonce is drawn, and none of them.
        undrafted: Empty fields that no person can fill: params.yaml has to give them, and the card
            to be drafted again.
        rehearsed: Why nothing of it can be signed; empty where it can.
        refusal: Why the card that lies there is refused; empty if none is.
        missing: Why nothing is shown; empty if something is.
        beyond: Whether the box reaches beyond where rollouts of the candidate went.
    """

    items: tuple[Item, ...] = ()
    caveats: int = 0
    signed: tuple[str, ...] = ()
    lacking: tuple[str, ...] = ()
    fields: tuple[str, ...] = ()
    undrafted: tuple[str, ...] = ()
    rehearsed: str = ""
    refusal: str = ""
    missing: str = ""
    beyond: bool = False

    @property
    def pending(self) -> str:
        """What waits for people: `5 signatures, 7 fields`; empty where nothing does, or can."""
        if self.rehearsed:
            return ""
        if self.missing:
            return "the card is not drawn"
        if self.refusal:
            return "the card that lies here is refused"
        open_ones = ((len(self.lacking), "signature"), (len(self.fields), "field"))
        counted = [f"{n} {what}{'s' if n > 1 else ''}" for n, what in open_ones if n]
        given = [f"a draft with {' and '.join(self.undrafted)}"] if self.undrafted else []
        return ", ".join([*given, *counted])


def papers_of(reports: Mapping[Gate, GateReport], evidence: Evidence) -> Papers | None:
    """The card that Gate E judged, as draft and as signed; None where there is none to show."""
    report = reports.get("E")
    if report is None:
        return None
    try:
        require_bound(evidence, report, DRAFT_PATH)
    except MissingEvidenceError:
        return None
    return examine(evidence.root, str(report.settings["card"]))


def card_of(papers: Papers | None) -> TrialCard | None:
    """The signed card, or the draft."""
    if papers is None:
        return None
    return papers.signed.card if papers.signed else papers.draft


def signing_of(
    reports: Mapping[Gate, GateReport],
    evidence: Evidence,
    papers: Papers | None,
    beside: Rows | None = None,
) -> Signing:
    """The fields of the card beside what was seen.

    Args:
        reports: By gate.
        evidence: Below the same root.
        papers: As `papers_of` gives them.
        beside: Files of rows that are printed beside the page of gate D; None where none are.
    """
    draft = papers.draft if papers else None
    if papers is None or draft is None or "D" not in reports:
        return Signing(missing="no card is drafted; only a gate D that passes leads to one")
    if draft.reports != upstream_hashes(evidence.root, "E"):
        # While a gate is judged again, the draft of the run before still lies there.
        return Signing(missing="the card that lies here was drafted from other reports")
    people = papers.signed.signers if papers.signed else ()
    roles = {person.role for person in people}
    beyond = any((told := BEYOND.match(c)) and told[1] == draft.candidate for c in draft.caveats)
    items = _items(draft, papers.signed.card if papers.signed else None, reports, evidence)
    whose = {FORCE: draft.candidate, INSTEAD: _policy(reports, evidence)}
    items = tuple(replace(item, rows=_rows(item, whose, reports["D"], beside)) for item in items)
    if rehearsed(reports):
        unsigned = tuple(replace(item, yours=item.yours or UNSIGNED) for item in items)
        caveats = len(draft.caveats)
        return Signing(items=unsigned, caveats=caveats, rehearsed=REHEARSED, beyond=beyond)
    open_ones = missing_fields(papers.signed.card if papers.signed else draft)
    return Signing(
        items=items,
        caveats=len(draft.caveats),
        signed=tuple(f"{person.id} ({person.role})" for person in people),
        lacking=tuple(role for role in SIGNERS if role not in roles),
        fields=tuple(name for name in open_ones if name != "nonce" and name not in FIXED),
        undrafted=tuple(undrafted(draft)),
        refusal=papers.refusal,
        beyond=beyond,
    )


def _rows(item: Item, whose: Mapping[str, str], report: GateReport, beside: Rows | None) -> str:
    """Where the rows under what was seen lie, beside the first page; empty where none do."""
    if beside is None or item.seen in (ELSEWHERE, NOTHING):
        return ""
    if item.field in (WORKSPACE, SPEED):
        found = beside.of(ENVELOPE_FILE)
    elif item.field in (FORCE, INSTEAD):
        of = beside.by_method(ROLLOUTS)
        found = [of[name] for name in (whose[item.field],) if name in of]
    else:
        names = {f"Ends it: {text}": ABORT_FROM[name] for name, text in ABORTS.items()}
        own = [c for c in report.criteria if c.candidate == whose[FORCE]]
        judged = [c for c in own if c.id == names.get(item.field)]
        again = [file for c in judged if (file := beside.recounted(c))]
        found = again or [file for c in judged for file in beside.under(c)]
    return f"{beside.folder}/{found[0].name}" if found else ""


def _items(
    draft: TrialCard,
    signed: TrialCard | None,
    reports: Mapping[Gate, GateReport],
    evidence: Evidence,
) -> tuple[Item, ...]:
    report = reports["D"]
    reached = _reached(draft.candidate, report, evidence)
    went = _box(reached.lowest_m, reached.highest_m) if reached else ELSEWHERE
    fastest = reached.fastest_m_s if reached else None
    box = _box(draft.workspace_lower_m, draft.workspace_upper_m)
    return (
        Item(WORKSPACE, went, box, AS_SIMULATED, "controller"),
        Item(
            SPEED,
            ELSEWHERE if fastest is None else f"at most {fastest:.3g} m/s",
            f"at most {draft.speed_limit_m_s:.3g} m/s",
            AS_SIMULATED,
            "controller",
        ),
        Item(
            FORCE,
            _force(draft.candidate, report, evidence),
            NOT_PROPOSED,
            _signed_force(signed),
            "safety",
        ),
        *_aborts(draft, signed, report),
        _rollback(reports, evidence),
        Item("Stop path", NOTHING, NOT_PROPOSED, signed.stop_path if signed else "", "safety"),
        Item("Who stands at it", NOTHING, NOT_PROPOSED, signed.spotter if signed else "", "safety"),
        Item(
            "Days of validity",
            NOTHING,
            NOT_PROPOSED,
            f"{signed.not_before} to {signed.expires}" if signed else "",
            REVIEWER,
        ),
    )


def _reached(candidate: str, report: GateReport, evidence: Evidence) -> Reached | None:
    """How far the candidate's commands went inside the envelope; None where it is not built."""
    try:
        require_bound(evidence, report, ENVELOPE_FILE)
        return evidence.document(STRESS, ENVELOPE).reached.get(candidate)
    except MissingEvidenceError:
        return None


def _box(low: Point | None, high: Point | None) -> str:
    if low is None or high is None:
        return ELSEWHERE
    sides = zip("xyz", low, high, strict=True)
    return ", ".join(f"{a} {MM_PER_M * x:.0f} to {MM_PER_M * y:.0f}" for a, x, y in sides)


def _signed_force(signed: TrialCard | None) -> str:
    """What people set; a card that lacks it is refused, and must be seen to lack it."""
    if signed is None:
        return ""
    if signed.force_limit_n is None:
        return MISSING
    return f"{signed.force_limit_n:.3g} N: {signed.force_limit_reason}"


def _force(candidate: str, report: GateReport, evidence: Evidence) -> str:
    try:
        require_bound(evidence, report, ROLLOUTS)
        force = numbers(evidence.of(ROLLOUTS, RolloutRow, candidate), "force_peak_n")
    except MissingEvidenceError:
        return ELSEWHERE
    touched = int((force > 0).sum())
    if touched == 0:
        return f"no contact in {len(force):,} of {len(force):,} rollouts: nothing is known"
    return f"at most {force.max():.3g} N; contact in {touched:,} of {len(force):,} rollouts"


def _aborts(draft: TrialCard, signed: TrialCard | None, report: GateReport) -> list[Item]:
    judged = {c.id: c for c in report.criteria if c.candidate == draft.candidate}
    items = []
    for name, most in sorted(draft.abort_thresholds.items()):
        answer: Answer = judged[ABORT_FROM[name]]
        items.append(
            Item(
                f"Ends it: {ABORTS[name]}",
                f"{at_its_end(answer)} in the worst condition; {draft.abort_windows[name].tried}",
                f"{human(answer, most)}, {draft.abort_windows[name].over}",
                _signed_threshold(signed, name, answer),
                answer.owner or "nobody",
            )
        )
    return items


def _signed_threshold(signed: TrialCard | None, name: str, answer: Answer) -> str:
    if signed is None:
        return ""
    value = signed.abort_thresholds.get(name)
    return MISSING if value is None else human(answer, value)


def _policy(reports: Mapping[Gate, GateReport], evidence: Evidence) -> str:
    """What a card would roll back to; empty where nobody can say."""
    try:
        return rollback_of(reports, evidence).policy
    except (MissingEvidenceError, IntegrityError, KeyError):
        return ""


def _rollback(reports: Mapping[Gate, GateReport], evidence: Evidence) -> Item:
    seen, proposed = ELSEWHERE, ELSEWHERE
    try:
        require_bound(evidence, reports["D"], ROLLOUTS)
        found = rollback_of(reports, evidence)
        share = 100 * found.succeeded / found.rollouts
        seen = f"succeeds in {share:.3g} %, {found.succeeded:,} of {found.rollouts:,} rollouts"
        known = found.checkpoint_sha256[:SHOWN_HASH]
        proposed = f"stop, then {found.policy} (checkpoint {known}…), or by hand"
    except (MissingEvidenceError, IntegrityError, KeyError):
        pass
    return Item(INSTEAD, seen, proposed, "as proposed", "model")
