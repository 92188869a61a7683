"""What a network and its training cost stands in the report; a count that contradicts is named."""

from types import SimpleNamespace

import evidence
import pandas as pd
import pytest
from asked import asked
from editing import cells

from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.tables_compute import LISTING, NOT_COUNTED
from gates.proof import judge
from gates.reproducibility.compute import COMPUTE, Cost, miscounted
from gates.reproducibility.gate import parameter_budget_deviation, unpinned_items
from genpolicy.evidence.rows.reproducibility import PARTS
from genpolicy.policies.settings import TrainingConfig

TABLE = COMPUTE.removeprefix("artifacts/")
BATCH = TrainingConfig().batch_size


def of(part):
    return lambda frame: (frame["method"] == "flow") & (frame["part"] == part)


def edit(root, part, column, value):
    evidence.edit_table(root, TABLE, cells(column, value, where=of(part)))


def test_the_report_says_parts_rule_and_operations(ladder):
    found = asked(ladder, parameter_budget_deviation, "flow", gate="B")
    assert "encoder 10 and 1, trunk 80 and 1, head 10 and 1" in found.caveat
    # By hand: 9 operations a window, in each of 4000 updates.
    assert f"of {BATCH} windows, {9.0 * BATCH * 4000:.3g} operations" in found.caveat
    assert "training: 4000 updates (a number that was written before" in found.caveat
    assert "no loss stops or selects" in found.caveat


@pytest.mark.parametrize(
    ("part", "column", "value", "said"),
    [("trunk", "parameters", 81, "parameters of trunk: counted 81, trained as 80"),
     ("head", "operations", 0, "operations of head: counted 0, trained as 1"),
     ("trunk", "operations", 0, "operations of trunk: counted 0, trained as 1"),
     ("head", "operations", 5, "operations of head: counted 5, trained as 1"),
     ("encoder", "operations", 5, "operations of encoder: counted 5, trained as 1")],
)  # fmt: skip
def test_a_count_that_training_did_not_write_is_not_pinned(ladder, part, column, value, said):
    edit(ladder, part, column, value)
    found = asked(ladder, unpinned_items, "flow", gate="B")
    assert (found.value, found.caveat) == (1.0, said)


def test_products_outside_of_layers_contradict_nothing(ladder):
    edit(ladder, "trunk", "operations", 5)
    assert asked(ladder, unpinned_items, "flow", gate="B").value == 0.0


def test_a_part_that_training_does_not_name_is_not_pinned(ladder):
    cost = Cost(dict.fromkeys(PARTS, 1), {**dict.fromkeys(PARTS, 0), "head": 1}, 0, 9, 1, 1)
    config = SimpleNamespace(
        parameters={**dict.fromkeys(PARTS, 1), "total": 3},
        training_only_parameters=0,
        flops={"head": 1},
    )
    assert miscounted(cost, config) == [
        "operations of encoder: counted 0, trained as None",
        "operations of trunk: counted 0, trained as None",
    ]


def test_parts_that_are_not_the_whole_are_not_pinned(ladder):
    """Both count a trunk of ten, and the budget is held against a total of a hundred."""

    def smaller(document):
        document["methods"]["flow"]["config"]["parameters"]["trunk"] = 10

    evidence.edit_document(ladder, "train_generators/matched.json", smaller)
    edit(ladder, "trunk", "parameters", 10)
    found = asked(ladder, unpinned_items, "flow", gate="B")
    assert found.caveat == (
        "parameters of all parts: counted 30, trained as 100, "
        "parameters: matched.json counts others than its configuration"
    )


def test_a_training_without_an_operation_was_not_counted(ladder):
    edit(ladder, "update", "operations", 0)
    found = asked(ladder, unpinned_items, "flow", gate="B")
    assert found.value == 1.0 and "none of a window's training" in found.caveat


def test_a_training_seed_that_nobody_counted_is_missing(ladder):
    def further(frame):
        return pd.concat([frame, frame[frame["method"] == "flow"].assign(seed=1)])

    evidence.edit_table(ladder, "reload/samples.parquet", further)
    with pytest.raises(MissingEvidenceError, match="does not count encoder of flow once"):
        asked(ladder, unpinned_items, "flow", gate="B")


@pytest.mark.parametrize("part", ["encoder", "update"])
def test_a_part_that_nobody_counted_is_missing_by_name(ladder, part):
    evidence.edit_table(ladder, TABLE, lambda frame: frame[~of(part)(frame)])
    with pytest.raises(MissingEvidenceError, match=f"does not count {part} of flow"):
        asked(ladder, unpinned_items, "flow", gate="B")
    report = judge(ladder, "B")
    assert report.candidates["flow"] == "INCONCLUSIVE"


def test_the_page_has_candidates_counted_and_baselines_as_they_say(ladder):
    report = judge(ladder, "B")
    (found,) = draw_all((LISTING,), Evidence(ladder), report)
    lines = {line[0]: line[1:] for line in found.listed[1:]}
    # The encoder once, trunk and head at each of eight evaluations.
    assert lines["flow"][:4] == ("10, 1", "80, 1", "10, 1", "17 at NFE 8")
    assert lines["flow"][4] == f"4000 of {BATCH}" and lines["flow"][-1] == "none"
    assert lines["chunked_bc"][3] == NOT_COUNTED == lines["chunked_bc"][5]
    assert lines["flow"][6].startswith("4 % (")
    assert LISTING.title in gate_page(ladder, report)
