"""First line of the desk: which task, robot, candidate and people the page is about.

When the ladder ran, at which commit, and when it was last proved are not on the page: the same
evidence must give the same bytes. `genpolicy report status` says these.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from gates.card.card import TrialCard
from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.bound import require_bound
from gates.pages.desk import other_below
from gates.pipeline import TASK, TASK_IDENTITY
from gates.report import Gate, GateReport
from gates.settings import read_params
from genpolicy.documents.task import IDENTITY
from genpolicy.errors import GenpolicyError

NOBODY = "an author who is not named"


@dataclass(frozen=True)
class Line:
    """Who and what.

    Attributes:
        task: Its name.
        robot: Name of the robot model in the scene.
        candidate: The promoted method; empty where none is.
        authors: Who made it, as its card names them, or before one is drafted `params.yaml`; empty
            where neither lies here.
        signed: Whether a signed card covers these very reports.
    """

    task: str
    robot: str
    candidate: str
    authors: str
    signed: bool


def line_of(reports: Mapping[Gate, GateReport], evidence: Evidence, card: TrialCard | None) -> Line:
    """The line of the reports that lie there.

    Args:
        reports: By gate.
        evidence: Below the same root.
        card: The signed or drafted card of these reports; None without one.
    """
    task, robot = _task(reports, evidence)
    return Line(
        task=task,
        robot=robot,
        candidate=(reports["D"].promoted or "") if "D" in reports else "",
        authors=_authors(evidence) if card is None else ", ".join(card.authors) or NOBODY,
        signed="E" in reports
        and reports["E"].verdict == "PASS"
        and other_below(reports, "E") is None,
    )


def _authors(evidence: Evidence) -> str:
    try:
        named = (read_params(evidence.root).get("card") or {}).get("authors")
    except GenpolicyError:
        return ""
    return ", ".join(map(str, named or ())) or NOBODY


def _task(reports: Mapping[Gate, GateReport], evidence: Evidence) -> tuple[str, str]:
    """Name of the task and of its robot, by the identity that every report names."""
    try:
        for report in reports.values():
            require_bound(evidence, report, TASK_IDENTITY)
        identity = evidence.document(TASK, IDENTITY)
    except MissingEvidenceError:
        return "task not built here", "robot not built here"
    return identity.name, identity.robot
