"""Both kinds of evidence beside each other, and what to record next time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from genpolicy.audit.question_names import CLOCK, OUTCOME_MISSING
from genpolicy.audit.reach_rows import LEARNED, LOCAL
from genpolicy.pages.audit.evidence import AuditEvidence

HEADINGS = {
    LOCAL: "Near neighbours",
    LEARNED: "Alike in what predicts, of the route alone",
}
ORDINALS = ("first", "second", "third", "fourth", "last")
RECORD = {
    "operator": "who demonstrated each episode (column operator)",
    "object": "which object each episode is about (column object)",
    "calibration_epoch": "under which calibration it was recorded (column calibration_epoch)",
    "order": "when each episode was recorded, by a clock that runs on through all of them",
    "constant_lag": "when each sample was received, beside when it happened, or declare the lag",
}
"""What a question that was not asked would need of the recordings."""


@dataclass(frozen=True)
class Kind:
    """One kind of evidence, as a column of the table.

    Attributes:
        heading: What it compares, and of which component its modes are where that is known.
        followed: Whether the rest of the page is about its situations.
        spoke: Situations of which it could speak, and of how many.
        fifths: The same for each fifth of the way.
        episodes: Held-out episodes in which it shows modes, and of how many.
        kept: Share of the episodes that keep their mode a chunk later, what chance reaches in 95
            of 100, and situations in which that was measured; None where none was.
        again: Situations of the other kind with modes that have them here as well, and that have
            none though they would be found; None where none was asked again.
    """

    heading: str
    followed: bool
    spoke: tuple[int, int]
    fifths: tuple[tuple[int, int], ...]
    episodes: tuple[int, int]
    kept: tuple[float, float, int] | None
    again: tuple[int, int] | None


def kinds(evidence: AuditEvidence) -> list[Kind]:
    """Both kinds of evidence, in the order in which they are asked."""
    reach = evidence["reach"].sort_values("fifth")
    components = evidence["components"]
    followed = ", ".join(components.loc[components["followed"].astype(bool), "component"])
    result = []
    for _, row in evidence["sides"].iterrows():
        own = reach[reach["kind"] == row["kind"]]
        again = int(row["confirmed"]), int(row["contradicted"])
        heading = HEADINGS[str(row["kind"])]
        if row["followed"] and row["kind"] == LOCAL:
            heading += f", of {followed}"
        result.append(
            Kind(
                heading=heading,
                followed=bool(row["followed"]),
                spoke=(int(row["analysed"]), int(row["queries"])),
                fifths=tuple(
                    (int(spoke), int(queries))
                    for spoke, queries in zip(own["spoke"], own["queries"], strict=True)
                ),
                episodes=(int(row["two_mode_episodes"]), int(row["analysed_episodes"])),
                kept=(float(row["kept"]), float(row["kept_null_q95"]), int(row["kept_n"]))
                if row["kept_n"]
                else None,
                again=again if any(again) else None,
            )
        )
    return result


def record_next(document: Mapping[str, Any], evidence: AuditEvidence) -> list[str]:
    """What the recordings lack for the questions that were not asked, most wanted first.

    Args:
        document: `audit.json`, with its limits.
        evidence: The evidence beside it.
    """
    asked = evidence["asked"]
    missing = asked.loc[~asked["asked"].astype(bool), "check"].astype(str).tolist()
    lines = ["whether each episode succeeded"] if OUTCOME_MISSING in document["rests_on"] else []
    thin = _thin(evidence, _limit(document, "denial_share"))
    if thin:
        settings = evidence.settings
        least = int(settings["minimum_neighbours"])
        lines.append(
            f"more episodes from the same starts: in the {_listed(thin)} fifth of the way fewer "
            f"situations than it takes to deny modes have {least} comparable episodes"
        )
    lines += [RECORD[name] for name in RECORD if name in missing]
    clocks = [name.removeprefix(CLOCK) for name in missing if name.startswith(CLOCK)]
    lines += [f"when each sample of {name} was received" for name in clocks]
    return lines


def _thin(evidence: AuditEvidence, least: float) -> list[str]:
    """Fifths of the way in which neither kind of evidence speaks of enough situations."""
    best = [0.0] * len(ORDINALS)
    for _, row in evidence["reach"].iterrows():
        place, queries = int(row["fifth"]) - 1, int(row["queries"])
        share = float(row["spoke"]) / queries if queries else 1.0
        best[place] = max(best[place], share)
    return [name for name, share in zip(ORDINALS, best, strict=True) if not share - least >= 0]


def _limit(document: Mapping[str, Any], question: str) -> float:
    return next(
        float(questions[question][0])
        for questions in document["limits"].values()
        if question in questions
    )


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
