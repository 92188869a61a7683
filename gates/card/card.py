"""The trial card: what an independent person must read, complete and sign.

Code drafts it from the passed reports. There is no default force limit: a number that no one
measured for this cell would look like a safe one. An empty field keeps the card incomplete.
"""

import datetime
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import Field

from gates.card.envelope import Simulated, beyond_simulation
from gates.card.people import ID_FORM, PersonId
from gates.card.windows import AbortWindow
from gates.claim import CHECKPOINT_ONLY
from gates.doubts import for_a_card
from gates.floors import HARDEST_CONTACT_N
from gates.overrides import is_said
from gates.report import Gate, GateReport, Point, StrictModel, parse_section
from gates.settings import GateSettings
from genpolicy.contract.names import says
from genpolicy.errors import RefusedError
from genpolicy.evidence.failure_search.settings import SearchSettings
from genpolicy.integrity.documents import canonical_json, parse_json

CARD_SCHEMA_VERSION = 3
DRAFT_PATH = "artifacts/card/card.json"
CardName = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,63}$")]

# What the draft fixes; a signed card may not differ here from the draft of this very chain.
# Caveats are not among them, since people may add some: see `left_out`.
FIXED = (
    "schema_version",
    "name",
    "task",
    "candidate",
    "candidate_checkpoint_sha256",
    "robot_model",
    "authors",
    "reports",
    "workspace_lower_m",
    "workspace_upper_m",
    "speed_limit_m_s",
    "abort_windows",
    "rollback",
)
ABORT_FROM = {
    "latency_s": "latency_p95_s",
    "deadline_miss_share": "deadline_miss_upper",
    "hold_share": "hold_share_upper",
    "rejection_share": "rejection_share_upper",
    "fallback_share": "fallback_share_upper",
    "intervention_share": "intervention_upper",
    "reset_share": "reset_upper",
}


class CardSettings(GateSettings):
    """Section `card` of `params.yaml`: what the draft starts from.

    Attributes:
        name: File name of the signed card: `cards/<name>.dsse.json`.
        authors: Who made the candidate, by identifier on the allow-list; they sign nothing.
        failure_search: How long failures are searched for before the draft.
        task: Name of the task.
    """

    homes: ClassVar[Mapping[str, str]] = {"task": "task.name"}

    name: CardName
    authors: tuple[PersonId, ...]
    failure_search: SearchSettings = Field(default_factory=SearchSettings)
    task: str = Field(min_length=1)


class TrialCard(StrictModel):
    """Reduced envelope and duties of one trial of one candidate on one robot model.

    Empty text and None mean: a person has still to fill this in.

    Attributes:
        robot_model: The one robot model that the card is for.
        authors: Who made the candidate, by identifier on the allow-list.
        reports: SHA-256 of the reports of gates A to D.
        workspace_lower_m: Lower corner of the workspace that was simulated, base frame. (3,).
        workspace_upper_m: Upper corner. (3,).
        speed_limit_m_s: Most for the speed of the tool, as simulated.
        force_limit_n: Contact force at which the trial stops, N; measured for this cell.
        force_limit_reason: Where the force limit comes from.
        spotter: Who stands at the stop, by identifier on the allow-list.
        stop_path: How the robot is stopped, from hand to drive.
        abort_thresholds: What ends the trial, by name; may be lowered, never raised.
        abort_windows: Over what each of them is counted.
        rollback: What runs instead: one policy, its checkpoint, its own success.
        caveats: What the reports do not show, what could make them wrong, what moved since the
            plan; people may add some.
        not_before: First day of validity, YYYY-MM-DD.
        expires: Last day of validity, YYYY-MM-DD.
        nonce: Makes this card unlike any other; at least 16 printable ASCII characters.
    """

    schema_version: int
    name: str
    task: str
    candidate: str
    candidate_checkpoint_sha256: str
    robot_model: str
    authors: tuple[str, ...]
    reports: dict[str, str]
    workspace_lower_m: Point
    workspace_upper_m: Point
    speed_limit_m_s: float
    force_limit_n: float | None
    force_limit_reason: str
    spotter: str
    stop_path: str
    abort_thresholds: dict[str, float]
    abort_windows: dict[str, AbortWindow]
    rollback: str
    caveats: tuple[str, ...]
    reviewer: str
    not_before: str
    expires: str
    nonce: str


def draft_card(
    settings: CardSettings,
    reports: Mapping[Gate, GateReport],
    hashes: Mapping[Gate, str],
    checkpoint: str,
    *,
    simulated: Simulated,
    windows: Mapping[str, AbortWindow],
    rollback: str,
) -> TrialCard:
    """Draft from the passed reports, with the fields of the reviewer left empty.

    Args:
        settings: Section `card`.
        reports: Passed reports of gates A to D, as `gates.proof.admit` gives them.
        hashes: Their SHA-256.
        checkpoint: Hash of the promoted candidate's checkpoint, as Gate B pinned it.
        simulated: Robot, workspace and speed that its rollouts were held to.
        windows: Over what each threshold is counted.
        rollback: What runs instead, as `gates.card.rollback` says it.

    Raises:
        RefusedError: Gate D promotes no one.
    """
    return TrialCard(
        schema_version=CARD_SCHEMA_VERSION,
        name=settings.name,
        task=settings.task,
        candidate=promoted(reports["D"]),
        candidate_checkpoint_sha256=checkpoint,
        robot_model=simulated.robot,
        authors=settings.authors,
        reports={str(gate): digest for gate, digest in sorted(hashes.items())},
        workspace_lower_m=simulated.workspace_lower_m,
        workspace_upper_m=simulated.workspace_upper_m,
        speed_limit_m_s=simulated.speed_limit_m_s,
        force_limit_n=None,
        force_limit_reason="",
        spotter="",
        stop_path="",
        abort_thresholds=thresholds_of(reports["D"]),
        abort_windows=dict(windows),
        rollback=rollback,
        caveats=caveats_of(reports),
        reviewer="",
        not_before="",
        expires="",
        nonce="",
    )


def thresholds_of(report: GateReport) -> dict[str, float]:
    """Limits of Gate D that end a trial, by the name of the threshold."""
    limits = {c.id: c.threshold for c in report.criteria if c.threshold is not None}
    return {name: limits[found] for name, found in ABORT_FROM.items() if found in limits}


def caveats_of(reports: Mapping[Gate, GateReport]) -> tuple[str, ...]:
    """What a signer signs in spite of, each once, after what was tested at all.

    The caveats of the reports, limits that somebody overrides before all others, then what could
    make them wrong: near a limit, judged at a point.

    Raises:
        RefusedError: Gate D promotes no one.
    """
    candidate = promoted(reports["D"])
    found = [caveat for gate in sorted(reports) for caveat in reports[gate].caveats]
    found.sort(key=lambda caveat: not is_said(caveat))
    doubts = [text for gate in sorted(reports) for text in for_a_card(reports[gate], candidate)]
    return tuple(dict.fromkeys([CHECKPOINT_ONLY, *found, *doubts]))


def left_out(required: Sequence[str], card: TrialCard) -> list[str]:
    """Caveats that the card does not repeat, word for word; others beside them may stand."""
    return [caveat for caveat in required if caveat not in card.caveats]


def promoted(report: GateReport) -> str:
    """The method that Gate D promotes.

    Raises:
        RefusedError: None.
    """
    name = report.promoted
    if report.verdict != "PASS" or name is None or report.candidates.get(name) != "PASS":
        nobody = "Keep the simpler policy; there is nothing to put on a card."
        raise RefusedError(
            gate="D",
            criterion="promoted",
            measured=name or "none",
            limit="a method that passed",
            report="reports/gate_d.json",
            action=report.decision if report.verdict == "PASS" and name is None else nobody,
        )
    return name


def card_bytes(card: TrialCard) -> bytes:
    """The one serialisation of a card."""
    return canonical_json(card.model_dump(mode="json"))


def missing_fields(card: TrialCard) -> list[str]:
    """Fields that are still empty or say nothing a reader can see; a force limit is never implied.

    A text of spaces, dashes or characters without a shape is an empty one, and one that hides such
    characters among others is not what its reader reads. A spotter is an identifier: whom a name
    means, nobody can hold against the allow-list.
    """
    dump: dict[str, Any] = card.model_dump()
    empty = [name for name, value in dump.items() if value in (None, "", {}, ())]
    texts = {name: value for name, value in dump.items() if isinstance(value, str) and value}
    silent = [name for name, value in texts.items() if not says(value)]
    short = [] if re.fullmatch(r"[!-~]{16,}", card.nonce) else ["nonce"]
    nobody = [] if re.fullmatch(ID_FORM, card.spotter) else ["spotter"]
    reports = ["reports"] if set(card.reports) != {"A", "B", "C", "D"} else []
    return sorted({*empty, *silent, *short, *nobody, *reports} - {"caveats"})


def undrafted(card: TrialCard) -> list[str]:
    """Fields among those that are empty which the draft fixes: no person can fill them in."""
    return [name for name in missing_fields(card) if name in FIXED]


def envelope_violations(card: TrialCard, draft: TrialCard, simulated: Simulated) -> list[str]:
    """Limits of the card that are not those of the simulated envelope, or impossible.

    Workspace and speed are exactly those that the candidate's rollouts were held to: of another
    box or speed, tighter ones too, nobody knows whether the policy works there. Every comparison
    accepts with `<=`, so that NaN does not pass.
    """
    bad = beyond_simulation(simulated, card.candidate)
    for name in ("workspace_lower_m", "workspace_upper_m", "speed_limit_m_s"):
        if getattr(card, name) != getattr(simulated, name):
            bad.append(f"{name} other than simulated")
    if card.robot_model != simulated.robot:
        bad.append("robot_model other than simulated")
    if card.force_limit_n is None or not 0 < card.force_limit_n <= HARDEST_CONTACT_N:
        bad.append("force_limit_n")
    for name in sorted({*ABORT_FROM, *draft.abort_thresholds, *card.abort_thresholds}):
        value, limit = card.abort_thresholds.get(name), draft.abort_thresholds.get(name)
        if value is None or limit is None or not 0 <= value <= limit:
            bad.append(f"abort_thresholds.{name}")
    return bad


def validity(card: TrialCard, *, today: datetime.date, maximum_days: int) -> tuple[bool, str]:
    """Whether the card is valid on a day, and the sentence that says why not.

    The first and the last day count: a card of one day begins and expires on it.
    """
    if not all(re.fullmatch(r"\d{4}-\d{2}-\d{2}", t) for t in (card.not_before, card.expires)):
        return False, "not_before and expires must be days, YYYY-MM-DD"
    try:
        first = datetime.date.fromisoformat(card.not_before)
        last = datetime.date.fromisoformat(card.expires)
    except ValueError:
        return False, "not_before or expires is no day of the calendar"
    for wrong, text in (
        (last < first, "the card expires before it begins"),
        ((last - first).days + 1 > maximum_days, f"valid for more than {maximum_days} days"),
        (today < first, f"valid only from {card.not_before}"),
        (today > last, f"expired on {card.expires}"),
    ):
        if wrong:
            return False, text
    return True, f"valid from {card.not_before} to {card.expires}"


def read_card(data: bytes, *, where: str) -> TrialCard:
    """A card from its JSON.

    Raises:
        BadInputError: Not strict JSON, or not a card.
    """
    return parse_section(TrialCard, parse_json(data, where=where), where=where)


def draft_path(root: Path) -> Path:
    """Where the draft lies."""
    return root / DRAFT_PATH
