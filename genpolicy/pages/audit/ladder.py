"""The layers of the diagnosis with every number held against its limit.

Which layer is the first red one the audit has decided; here it is only shown. What lies below it
is shown too, and marked as not to be believed while the layer above is red.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from genpolicy.pages.audit.evidence import AuditEvidence

HOLDS, RED, OPEN, UNBELIEVED = "holds", "red", "open", "not believed"
AT_MOST, AT_LEAST = "≤", "≥"
SHOWN = 8
UNIT_OF_POSITION = "unit of the position"


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
        judged: Whether the limit alone decides; where the measurement has an error of its own, a
            defect is only what lies beyond both, and stands among the defects.
    """

    what: str
    measured: float | None
    limit: float | None = None
    comparison: str = AT_MOST
    unit: str = ""
    note: str = ""
    judged: bool = True

    @property
    def holds(self) -> bool | None:
        """Whether the number keeps its limit; None where that is not to be said."""
        if self.measured is None or self.limit is None or not self.judged:
            return None
        margin = self.limit - self.measured
        return margin >= 0 if self.comparison == AT_MOST else -margin >= 0


@dataclass(frozen=True)
class Layer:
    """One layer of the diagnosis.

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


def ladder(document: Mapping[str, Any], evidence: AuditEvidence) -> list[Layer]:
    """The six layers in the order in which they are believed.

    Args:
        document: `audit.json`.
        evidence: The evidence beside it.
    """
    found = (
        ("data", "Are clocks, frames, units and calibration what they claim to be?", _data),
        ("labels", "Do the outcome labels agree with what a replay does?", _labels),
        ("support", "Are there enough comparable demonstrations to answer at all?", _support),
        (
            "structure",
            "Has one observation several actions, and do they persist?",
            _structure,
        ),
        ("hidden", "Does a recorded variable, or the past, explain which one was taken?", _hidden),
        ("validity", "Does each mode succeed, and is it feasible?", _validity),
    )
    red = [name for name, _, _ in found].index(document["layer"]) if _is_red(document) else None
    result = []
    for place, (name, question, measure) in enumerate(found):
        checks = tuple(measure(evidence))
        if red is not None and place >= red:
            state = RED if place == red else UNBELIEVED
        else:
            state = HOLDS if any(check.holds is not None for check in checks) else OPEN
        result.append(Layer(name, question, checks, state))
    return result


def _is_red(document: Mapping[str, Any]) -> bool:
    return bool(document["layer"] != "none")


def _data(evidence: AuditEvidence) -> list[Check]:
    settings, summary = evidence.settings, evidence.summary
    defects = evidence["defects"]
    checks = [Check("defects found", float(len(defects)), 0.0)]
    for _, row in defects.head(SHOWN).iterrows():
        checks.append(_defect(row, str(summary["position_unit"])))
    offset = _largest(evidence["clocks"], "offset_before_s")
    if offset is None:
        note = "not measured: nothing that is observed follows the action"
        checks.append(Check("largest clock offset of an epoch", None, note=note))
    else:
        place = f"{offset['stream']}, epoch {offset['epoch'] or 'not recorded'}"
        value = abs(float(offset["offset_before_s"]))
        limit = float(settings["clock_limit_s"])
        checks.append(
            Check(
                "largest clock offset of an epoch", value, limit, unit="s", note=place,
                judged=False,
            )
        )  # fmt: skip
    residual = _largest(evidence["calibration"], "residual_m")
    if residual is not None:
        checks.append(
            Check(
                "largest calibration residual of an epoch",
                float(residual["residual_m"]),
                float(settings["calibration_limit_m"]),
                unit=str(summary["position_unit"]),
                note=f"epoch {residual['epoch'] or 'not recorded'}",
                judged=False,
            )
        )
    checks += [
        Check("samples received before they happened", float(summary["negative_delays"]), 0.0),
        Check("rows that follow a gap in time", float(summary["gaps"])),
        Check(
            "median start position, training against held-out",
            float(summary["start_drift"]),
            unit=str(summary["position_unit"]),
        ),
    ]
    return checks


def _defect(row: pd.Series, position_unit: str) -> Check:
    measured, limit = float(row["measured"]), float(row["limit"])
    name = f"{row['kind']} {row['variable']}".replace("_", " ").strip()
    comparison = AT_LEAST if measured < limit else AT_MOST
    unit = position_unit if row["unit"] == UNIT_OF_POSITION else str(row["unit"])
    return Check(name, measured, limit, comparison, unit=unit, note=str(row["where"]))


def _labels(evidence: AuditEvidence) -> list[Check]:
    summary = evidence.summary
    replays = int(summary["label_replays"])
    if replays == 0:
        why = "no replay: labels are taken as they are"
        return [Check("labels that disagree with a replay, upper bound", None, note=why)]
    return [
        Check(
            "labels that disagree with a replay, upper bound",
            float(summary["label_disagreement_upper"]),
            float(evidence.settings["label_disagreement_limit"]),
            note=f"{int(summary['label_disagreements'])} of {replays} replayed",
        )
    ]


def _support(evidence: AuditEvidence) -> list[Check]:
    counts, settings = evidence.summary["counts"], evidence.settings
    queries = int(counts["queries"])
    return [
        Check(
            "held-out episodes with enough comparable demonstrations",
            float(counts["analysed_episodes"]),
            float(settings["minimum_situations"]),
            AT_LEAST,
            note=f"{settings['minimum_neighbours']} or more within {settings['radius']:.3g} scales",
        ),
        Check(
            "share of held-out situations with enough of them",
            counts["analysed"] / queries if queries else 0.0,
            float(settings["minimum_support_share"]),
            AT_LEAST,
            note=f"{counts['analysed']} of {queries}",
        ),
    ]


def _structure(evidence: AuditEvidence) -> list[Check]:
    checks = _modes_found(evidence)
    counts, settings = evidence.summary["counts"], evidence.settings
    if counts["two_mode_episodes"] < counts["needed_episodes"]:
        queries = int(counts["queries"])
        checks.append(
            Check(
                "share of situations with enough demonstrations to deny modes",
                counts["analysed"] / queries if queries else 0.0,
                float(settings["minimum_absence_share"]),
                AT_LEAST,
                note="modes may hide in the others",
            )
        )
    return checks


def _modes_found(evidence: AuditEvidence) -> list[Check]:
    counts, settings = evidence.summary["counts"], evidence.settings
    kept = evidence.persistence
    least = float(settings["minimum_two_mode_situations"])
    measured = int(kept["n"]) > 0
    return [
        Check(
            "held-out episodes with several modes",
            float(counts["two_mode_episodes"]),
            float(counts["needed_episodes"]),
            AT_LEAST,
            note=f"{counts['two_mode']} situations; {counts['resolved']} more have clusters that "
            "the observation tells apart",
        ),
        Check(
            "situations that go on long enough to see them persist", float(kept["n"]), least,
            AT_LEAST,
        ),
        Check(
            "episodes that keep their mode a chunk later",
            float(kept["observed"]) if measured else None,
            float(kept["null_q95"]) if measured else None,
            AT_LEAST,
            note="the limit is what chance reaches in 95 of 100" if measured else "not measured",
        ),
        Check(
            "spread that is noise from action to action",
            float(counts["noise_ratio"]),
            note="1 white noise, 0 smooth",
        ),
    ]  # fmt: skip


def _hidden(evidence: AuditEvidence) -> list[Check]:
    frame, settings = evidence["strata"], evidence.settings
    level, limit = float(settings["strata_alpha"]), float(settings["strata_effect_limit"])
    blank = sorted(set(frame.loc[~frame["recorded"].astype(bool), "variable"]))
    tested = frame[frame["p_adjusted"].notna() & frame["effect"].notna() & (frame["n"] > 0)]
    clear = tested[tested["p_adjusted"] <= level].sort_values(
        ["effect", "variable"], ascending=[False, True]
    )
    names = ", ".join(blank)
    checks = [
        Check(
            "variables tested against the modes", float(tested["variable"].nunique()),
            note=f"not recorded: {names}" if blank else "",
        )
    ]  # fmt: skip
    for _, row in clear.head(SHOWN).iterrows():
        seen = ", which the policy sees" if bool(row["observed"]) else ""
        detail = f"{row['detail']}; " if row["detail"] else ""
        checks.append(
            Check(
                f"share of the modes that {_plain(row['variable'])} explains{seen}",
                float(row["effect"]),
                limit,
                note=f"{detail}{row['phase']}, adjusted p {float(row['p_adjusted']):.3g}",
            )
        )
    if len(tested) and not len(clear):
        strongest = tested.sort_values(["p_adjusted", "variable"]).iloc[0]
        checks.append(
            Check(
                "largest share that one of them explains beyond chance", 0.0, limit,
                note=f"smallest adjusted p {float(strongest['p_adjusted']):.3g} "
                f"({_plain(strongest['variable'])})",
            )
        )  # fmt: skip
    return checks


def _validity(evidence: AuditEvidence) -> list[Check]:
    settings, summary = evidence.settings, evidence.summary
    frame = evidence["modes"]
    frame = frame[frame["phase"] == evidence.primary_phase].sort_values("mode")
    checks = [Check("modes followed over situations", float(len(frame)), 2.0, AT_LEAST)]
    for _, row in frame.head(SHOWN).iterrows():
        trials, checked = int(row["episodes"]), int(row["checked"])
        checks.append(
            Check(
                f"success of {row['mode']}, lower bound",
                float(row["success_lower"]) if trials else None,
                float(settings["mode_success_limit"]),
                AT_LEAST,
                note=f"{int(row['successes'])} of {trials} succeed" if trials else "not recorded",
            )
        )
        if checked:
            checks.append(
                Check(
                    f"feasible chunks of {row['mode']}",
                    int(row["admissible"]) / checked,
                    float(settings["mode_feasible_limit"]),
                    AT_LEAST,
                    note=f"{int(row['admissible'])} of {checked}",
                )
            )
    total = int(summary["mean_checked"])
    share = int(summary["mean_defeated"]) / total if total else None
    why = f"{summary['mean_defeated']} of {total} situations" if total else "no feasibility check"
    checks.append(Check("situations whose mean is refused where all modes pass", share, note=why))
    return checks


def _plain(variable: str) -> str:
    return "the past" if variable == "history" else variable.replace("_", " ")


def _largest(frame: pd.DataFrame, column: str) -> pd.Series | None:
    """The row with the largest absolute value; None where none is known."""
    known = frame[frame[column].notna()]
    if len(known) == 0:
        return None
    return known.iloc[int(np.argmax(np.abs(known[column].to_numpy(dtype=np.float64))))]
