"""The card on Gate E's own page: what one signs beside what was seen, then its other fields.

The fields that the first page shows are shown alike, so that both can be held side by side.
"""

from pathlib import Path
from typing import Any

from gates.card.card import DRAFT_PATH, TrialCard
from gates.card.papers import examine
from gates.card.people import SIGNERS
from gates.evidence import Evidence
from gates.pages.desk_card import Signing, signing_of
from gates.pages.guide import label
from gates.report import GATES, Gate, GateReport, read_report
from genpolicy.errors import IntegrityError

BESIDE = (
    "workspace_lower_m",
    "workspace_upper_m",
    "speed_limit_m_s",
    "force_limit_n",
    "force_limit_reason",
    "spotter",
    "stop_path",
    "abort_thresholds",
    "abort_windows",
    "rollback",
    "not_before",
    "expires",
)
"""Fields of a card that stand in the table of what one signs, beside what was seen."""

Fields = list[tuple[str, list[str]]]
"""Name of a field, and its lines."""


def card_shown(root: Path, report: GateReport) -> tuple[str, Fields, Signing | None]:
    """The card that lies below `root`: its state, its fields, and what one signs.

    Args:
        root: Repository root.
        report: Of the gate whose page it is; no other than Gate E has a card.

    Returns:
        How far it is signed, in words; the fields that do not stand beside what was seen; and
        those that do, None where the reports below do not lie here as the card names them.
    """
    if report.gate != "E" or not (root / DRAFT_PATH).is_file():
        return "", [], None
    papers = examine(root, str(report.settings["card"]))
    card: TrialCard | None = papers.signed.card if papers.signed else papers.draft
    if card is None:
        return "", [], None
    state = "draft, not signed"
    if papers.signed:
        asked = set(SIGNERS)
        found = asked & {person.role for person in papers.signed.signers}
        state = "signed" if found == asked else f"signed by {len(found)} of {len(asked)}"
    signing = signing_of(_below(root, report), Evidence(root), papers)
    left_out = () if signing.missing else BESIDE
    dumped: dict[str, Any] = card.model_dump(mode="json")
    dumped["abort_windows"] = {name: window.over for name, window in card.abort_windows.items()}
    fields = [(label(k), _lines(value)) for k, value in dumped.items() if k not in left_out]
    return state, fields, None if signing.missing else signing


def _below(root: Path, report: GateReport) -> dict[Gate, GateReport]:
    """The reports that can be read, with this one on top of them."""
    found: dict[Gate, GateReport] = {report.gate: report}
    for gate in GATES[: GATES.index(report.gate)]:
        try:
            found[gate] = read_report(root, gate)[0]
        except IntegrityError:
            continue  # their own pages say so
    return found


def _lines(value: Any) -> list[str]:
    """A field of the card as lines of text; none if it is empty."""
    if value in (None, "", [], {}):
        return []
    if isinstance(value, dict):
        return [f"{key}: {item}" for key, item in value.items()]
    if isinstance(value, list) and not any(isinstance(item, str) for item in value):
        return [", ".join(str(item) for item in value)]
    return [str(item) for item in value] if isinstance(value, list) else [str(value)]
