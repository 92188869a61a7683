"""Margins that contradict the verdict beside them are no evidence, and the gate gives none."""

import evidence
import numpy as np
import pandas as pd
import pytest
from layered import said_of

from gates.evidence import MissingEvidenceError
from gates.feasibility.margins import KNOWN, require_consistent
from gates.feasibility.settings import LAYERS
from gates.proof import judge
from genpolicy.feasibility.settings import LAYERS as ASKED
from genpolicy.feasibility.verdict import LayerOutcome

CANDIDATES = "shadow/candidates.parquet"
WHERE = "candidate flow/held_out/"


def rows_of(*verdicts):
    """One row each: passed, or (layer, outcome, reason, row)."""
    rows = []
    for number, verdict in enumerate(verdicts):
        layer, outcome, reason, row = verdict or (None, "passed", "", None)
        rows.append(
            {
                "method": "flow", "fixture": "held_out", "observation": number, "candidate": 0,
                **{name: name != layer for name in LAYERS}, "outcome": outcome,
                "first_reason": reason, "first_row": row,
            }
        )  # fmt: skip
    return said_of(pd.DataFrame(rows, dtype=object))


@pytest.fixture
def rows():
    """Passed, failed by a margin, failed without a number, and unknown."""
    found = rows_of(
        None, ("dynamic", "failed", "joint_jerk", 4), ("representation", "failed", "finite", 0),
        ("dynamic", "unknown", "measured_velocity", 1),
    )  # fmt: skip
    found.loc[2, ["margin_representation", "share_representation", "layer_margin"]] = None
    return found


def test_the_words_are_those_of_the_layers():
    assert LAYERS == ASKED and set(KNOWN) == {str(word) for word in LayerOutcome}


def test_what_the_layers_write_stands(rows):
    assert require_consistent(rows) is rows
    nothing = rows_of(None)
    for layer in LAYERS:
        nothing[[f"check_{layer}", f"unit_{layer}"]] = ""
        nothing[[f"margin_{layer}", f"share_{layer}"]] = None
    nothing[["margin_layer", "margin_check", "margin_unit"]] = ""
    nothing["layer_margin"] = None
    assert len(require_consistent(nothing)) == 1
    numberless = rows.assign(layer_margin=rows["layer_margin"].astype(float))
    assert require_consistent(numberless) is numberless


FORGED = {
    "kinematic passed with a margin below 0": (0, {"margin_kinematic": -0.01}),
    "dynamic failed with a margin of 0 or more": (1, {"margin_dynamic": 0.0}),
    "dynamic is unknown or was not reached, and has a margin": (3, {"margin_dynamic": -1.0}),
    "fresh is unknown or was not reached, and has a margin": (1, {"margin_fresh": 0.2}),
    "geometric has a margin that is no finite number": (0, {"margin_geometric": np.inf}),
    "kinematic has another share than margin": (0, {"share_kinematic": -0.4}),
    "contact has another share than margin": (0, {"share_contact": 0.4}),
    "geometric has a check or a unit alone": (0, {"unit_geometric": ""}),
    "kinematic has a margin of no check": (0, {"check_kinematic": "", "unit_kinematic": ""}),
    "contact passed, and its check has no margin": (0, {
        "check_contact": "contact_speed", "unit_contact": "m/s",
    }),
    "fresh was not reached, and has a check": (1, {"check_fresh": "expired", "unit_fresh": "s"}),
    "an action offends against kinematic, which did not reject": (0, {"row_kinematic": 3}),
    "an action offends against fresh, which did not reject": (1, {"row_fresh": 3}),
    "kinematic ended in no word of passed": (0, {"outcome_kinematic": "fine"}),
    "kinematic was reached in one column alone": (0, {"outcome_kinematic": "not_reached"}),
    "kinematic passed in one column alone": (0, {"outcome_kinematic": "failed"}),
    "fresh was reached behind a layer that rejected": (1, {
        "fresh": True, "outcome_fresh": "passed",
    }),
    "kinematic was not reached, and no layer before it rejected": (0, {
        "kinematic": None, "outcome_kinematic": "not_reached", "margin_kinematic": None,
        "share_kinematic": None, "check_kinematic": "", "unit_kinematic": "",
    }),
    "its outcome is not dynamic's": (1, {"outcome": "unknown"}),
    "its outcome is not that of its layers": (0, {"outcome": "failed"}),
    "dynamic rejects it, and not for its first reason": (1, {"first_reason": "scene_collision"}),
    "a reason, and no layer rejected": (0, {"first_reason": "joint_jerk"}),
    "its margin is of another than dynamic": (1, {"margin_layer": "kinematic"}),
    "layer_margin is not that of dynamic": (1, {"layer_margin": -0.3}),
    "layer_margin is not that of geometric": (0, {"layer_margin": 0.3}),
    "margin_unit is not that of dynamic": (1, {"margin_unit": "m"}),
    "margin_check is not that of dynamic": (1, {"margin_check": "joint_velocity"}),
    "first_row is not that of dynamic": (1, {"first_row": 5}),
    "first_row is not that of geometric": (0, {"first_row": 5}),
    "it passed, and no layer is its tightest": (0, {"margin_layer": ""}),
    "fresh is not the layer with the least share of its limit left": (0, {
        "margin_layer": "fresh", "margin_check": "stale_observation", "layer_margin": 0.25,
        "margin_unit": "s",
    }),
}  # fmt: skip


@pytest.mark.parametrize("said", FORGED)
def test_a_row_that_contradicts_itself_is_refused_by_name(rows, said):
    place, cells = FORGED[said]
    for column, value in cells.items():
        rows.at[place, column] = value
    with pytest.raises(MissingEvidenceError, match=f"{WHERE}{place}/0: {said}"):
        require_consistent(rows)


@pytest.mark.parametrize(("column", "value"), [("margin_layer", "fresh"), ("layer_margin", 0.3)])
def test_of_nothing_measured_there_is_no_tightest(column, value):
    nothing = rows_of(None)
    for layer in LAYERS:
        nothing[[f"check_{layer}", f"unit_{layer}"]] = ""
        nothing[[f"margin_{layer}", f"share_{layer}"]] = None
    nothing[["margin_layer", "margin_check", "margin_unit"]] = ""
    nothing["layer_margin"] = None
    nothing[column] = value
    with pytest.raises(MissingEvidenceError, match="and none of its layers measured one"):
        require_consistent(nothing)


def test_equal_shares_may_both_be_the_tightest(rows):
    rows["share_fresh"] = rows["share_fresh"].mask(rows["outcome"] == "passed", 0.2)
    assert require_consistent(rows) is rows


def test_a_margin_that_is_no_number_is_no_evidence(rows):
    rows.at[0, "margin_kinematic"] = "wide"
    with pytest.raises(MissingEvidenceError, match="column margin_kinematic holds no numbers"):
        require_consistent(rows)


def test_the_gate_gives_no_verdict_on_such_a_method_and_goes_on_with_others(ladder):
    def passed_below_0(frame):
        own = (frame["method"] == "flow") & (frame["fixture"] == "held_out")
        return frame.assign(margin_kinematic=frame["margin_kinematic"].mask(own, -0.01))

    assert judge(ladder, "C").candidates == {"diffusion": "PASS", "flow": "PASS"}
    evidence.edit_table(ladder, CANDIDATES, passed_below_0)
    report = judge(ladder, "C")
    assert report.candidates == {"diffusion": "PASS", "flow": "INCONCLUSIVE"}
    asked = [c for c in report.criteria if c.candidate == "flow" and c.measured is None]
    assert {c.id for c in asked} >= {"admissible_share", "corrupted_refused_share"}
    said = f"{WHERE}0/0: kinematic passed with a margin below 0, and 319 more"
    assert all(said in c.caveat for c in asked)
