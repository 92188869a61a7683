"""The topics of the diagnosis as they were judged: every question with its number and its limit.

Nothing is compared here. What lies below the first red topic is shown too, and marked as not to be
believed; numbers that no limit is held against stand beside the questions.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from genpolicy.pages.audit.evidence import AuditEvidence

HOLDS, RED, OPEN, UNBELIEVED = "holds", "red", "open", "not believed"
AT_MOST, AT_LEAST = "≤", "≥"
SIGNS = {"<=": AT_MOST, ">=": AT_LEAST}


@dataclass(frozen=True)
class Check:
    """One number and its limit.

    Attributes:
        what: What was measured.
        measured: The number; None where it is not known.
        limit: Its limit; None where it has none and is worth knowing only.
        comparison: How the two must stand to each other.
        unit: Unit of both; empty for counts and shares.
        note: Where, or why it is not known.
        holds: Whether the number keeps its limit; None where that was not judged.
    """

    what: str
    measured: float | None
    limit: float | None = None
    comparison: str = AT_MOST
    unit: str = ""
    note: str = ""
    holds: bool | None = None


@dataclass(frozen=True)
class TopicRow:
    """One topic of the diagnosis.

    Attributes:
        name: As in the verdict.
        question: What it asks.
        checks: Its numbers.
        state: `holds`, `red`, `open` (nothing could be measured) or `not believed`.
    """

    name: str
    question: str
    checks: tuple[Check, ...]
    state: str


def ladder(document: Mapping[str, Any], evidence: AuditEvidence) -> list[TopicRow]:
    """The topics in the order in which they are believed.

    Args:
        document: `audit.json`; its `questions` carry number, limit and answer.
        evidence: The evidence beside it.
    """
    names = list(TOPICS)
    red = names.index(document["layer"]) if document["layer"] in TOPICS else len(names)
    result = []
    for place, (name, (question, beside)) in enumerate(TOPICS.items()):
        judged = [_judged(item) for item in document["questions"] if item["layer"] == name]
        checks = (*judged, *beside(evidence))
        if place >= red:
            state = RED if place == red else UNBELIEVED
        else:
            # That no fault of the data was found is an answer; elsewhere no number is none.
            known = name == "data" or any(check.holds is not None for check in judged)
            state = HOLDS if known else OPEN
        result.append(TopicRow(name, question, checks, state))
    return result


def _judged(item: Mapping[str, Any]) -> Check:
    return Check(
        what=item["what"],
        measured=item["measured"],
        limit=item["limit"],
        comparison=SIGNS[item["comparison"]],
        unit=item["unit"],
        note=item["note"],
        holds=item["holds"],
    )


def _data(evidence: AuditEvidence) -> list[Check]:
    summary = evidence.summary
    unit = summary.position_unit
    checks = [Check("deviations beyond the noise", float(len(evidence["findings"])))]
    offset = _largest(evidence["clocks"], "offset_before_s")
    if offset is None:
        note = "not measured: nothing that is observed follows the action"
        checks.append(Check("largest clock offset of an epoch", None, note=note))
    else:
        place = f"{offset['stream']}, epoch {offset['epoch'] or 'not recorded'}"
        value = abs(float(offset["offset_before_s"]))
        checks.append(Check("largest clock offset of an epoch", value, unit="s", note=place))
    residual = _largest(evidence["calibration"], "residual_m")
    if residual is not None:
        place = f"epoch {residual['epoch'] or 'not recorded'}"
        value = float(residual["residual_m"])
        what = "largest calibration residual of an epoch"
        checks.append(Check(what, value, unit=unit, note=place))
    return [
        *checks,
        Check("rows that follow a gap in time", float(summary.gaps)),
        Check(
            "median start position, training against held-out",
            summary.start_drift,
            unit=unit,
        ),
    ]


def _support(evidence: AuditEvidence) -> list[Check]:
    settings = evidence.settings
    note = f"within {settings['radius']:.3g} scales"
    least = float(settings["minimum_neighbours"])
    checks = [Check("training episodes that make a comparison", least, note=note)]
    for _, side in evidence["sides"].iterrows():
        fifths = evidence["reach"][evidence["reach"]["kind"] == side["kind"]].sort_values("fifth")
        shares = ", ".join(
            f"{int(row['spoke'])} of {int(row['queries'])}" for _, row in fifths.iterrows()
        )
        what = EVIDENCE[str(side["kind"])]
        several = f"modes in {int(side['two_mode_episodes'])} held-out episodes"
        checks.append(
            Check(
                f"situations of which {what} can speak",
                float(side["analysed"]),
                note=f"by fifths of the way {shares}; {several}",
            )
        )
    return checks


def _structure(evidence: AuditEvidence) -> list[Check]:
    ratio = evidence.summary.counts.noise_ratio
    note = "1 white noise, 0 smooth"
    return [Check("spread that is noise from action to action", ratio, note=note)]


def _hidden(evidence: AuditEvidence) -> list[Check]:
    frame = evidence["strata"]
    blank = sorted(set(frame.loc[~frame["recorded"].astype(bool), "variable"]))
    tested = frame[frame["p_adjusted"].notna() & frame["effect"].notna() & (frame["n"] > 0)]
    note = f"not recorded: {', '.join(blank)}" if blank else ""
    count = float(tested["variable"].nunique())
    return [Check("variables tested against the modes", count, note=note)]


def _validity(evidence: AuditEvidence) -> list[Check]:
    summary = evidence.summary
    total = summary.mean_checked
    share = summary.mean_defeated / total if total else None
    why = f"{summary.mean_defeated} of {total} situations" if total else "no feasibility check"
    return [Check("situations whose mean is refused where all modes pass", share, note=why)]


def _nothing(evidence: AuditEvidence) -> list[Check]:
    return []


def _largest(frame: pd.DataFrame, column: str) -> pd.Series | None:
    """The row with the largest absolute value; None where none is known."""
    known = frame[frame[column].notna()]
    if len(known) == 0:
        return None
    return known.iloc[int(np.argmax(np.abs(known[column].to_numpy(dtype=np.float64))))]


EVIDENCE = {"local": "near neighbours", "learned": "demonstrations alike in what predicts"}
TOPICS: dict[str, tuple[str, Callable[[AuditEvidence], list[Check]]]] = {
    "data": ("Are clocks, frames, units and calibration what they claim to be?", _data),
    "labels": ("Do the outcome labels agree with what a replay does?", _nothing),
    "support": ("Are there enough comparable demonstrations to answer at all?", _support),
    "structure": ("Has one observation several actions, and do they persist?", _structure),
    "hidden": ("Does a recorded variable, or the past, explain which one was taken?", _hidden),
    "validity": ("Does each mode succeed, and is it feasible?", _validity),
    "agreement": ("Do resampled audits say the same?", _nothing),
}
"""Question of each topic, and its numbers that no limit is held against."""
