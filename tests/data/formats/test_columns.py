"""Labels and clocks, told by their names."""

import pytest

from genpolicy.data.formats.columns import BOOKKEEPING, NAMES, labels_of
from genpolicy.data.formats.contract import Labels
from genpolicy.data.formats.source import Column


def columns(*names, width=None):
    return [Column(name, width) for name in names]


def test_every_label_that_a_contract_knows_has_names():
    assert set(NAMES) == set(Labels.model_fields)


@pytest.mark.parametrize("label", NAMES)
def test_each_name_is_found_and_the_first_of_several_wins(label):
    for name in NAMES[label]:
        assert getattr(labels_of(columns("arm_x_m", name)), label) == name
    first, last = NAMES[label][0], NAMES[label][-1]
    assert getattr(labels_of(columns(last, first)), label) == first


def test_case_does_not_matter_and_the_columns_own_spelling_is_kept():
    assert labels_of(columns("Episode_Index", "Timestamp")).named() == {
        "episode": "Episode_Index", "time": "Timestamp",
    }  # fmt: skip


def test_a_column_of_several_numbers_is_no_label():
    assert labels_of(columns("task", "phase", width=3)).named() == {}


def test_what_the_layout_states_comes_first_also_that_there_is_none():
    found = labels_of(columns("success", "timestamp"), outcome=None, episode="demo")
    assert found.named() == {"episode": "demo", "time": "timestamp"}


def test_bookkeeping_is_no_sensor():
    assert BOOKKEEPING.isdisjoint({"state", "position", "action", "gripper"})
    assert {"reward", "done", "timestamp", "index"} <= BOOKKEEPING
