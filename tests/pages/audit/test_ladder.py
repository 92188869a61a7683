"""The ladder of layers on the page: the first red one is marked."""

import pytest
from audited_cases import document
from planar import SETTINGS, planar

from gates.cause import Answer, Topic
from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.run import audit
from genpolicy.pages.audit.evidence import read_evidence
from genpolicy.pages.audit.ladder import OPEN, RED, UNBELIEVED, ladder
from genpolicy.pages.audit.page import audit_page, label_table


@pytest.mark.parametrize(
    ("name", "red"),
    [("valid", None), ("clock", "data"), ("labels", "labels"), ("operator", "hidden"),
     ("one", "structure")],
)  # fmt: skip
def test_the_first_red_layer_is_marked_and_what_lies_below_is_not_believed(audits, name, red):
    evidence = read_evidence(audits[name])
    layers = ladder(document(audits[name]), evidence)
    assert [layer.name for layer in layers] == [layer.value for layer in Topic][:-1]
    states = {layer.name: layer.state for layer in layers}
    assert [n for n, state in states.items() if state == RED] == ([red] if red else [])
    names = list(states)
    below = names[names.index(red) + 1 :] if red else []
    assert all(states[n] == UNBELIEVED for n in below)
    for layer in layers:
        beyond = [check for check in layer.checks if check.holds is False]
        if layer.state == RED:
            assert beyond, f"{layer.name} is red, and no number of it is beyond its limit"
        elif layer.state != UNBELIEVED:
            assert not beyond, f"{layer.name} holds, but {beyond}"


def test_nothing_replayed_leaves_the_labels_open_not_green(audits, tmp_path):
    data, _ = planar(episodes=90)
    result = audit(data, SETTINGS, admissible=None, replay=None, root_seed=1)
    write_evidence(result, tmp_path, settings=SETTINGS)
    evidence = read_evidence(tmp_path)
    states = {layer.name: layer.state for layer in ladder(document(tmp_path), evidence)}
    assert states["labels"] == OPEN
    page = audit_page(document(tmp_path), evidence, name="no simulator")
    assert "No episode was replayed" in page and "mean, not checked" in page
    assert label_table(evidence) == []


@pytest.mark.parametrize(
    ("measured", "limit", "comparison", "holds"),
    [(1.0, 1.0, "<=", True), (1.1, 1.0, "<=", False), (1.0, 1.0, ">=", True),
     (0.9, 1.0, ">=", False), (float("nan"), 1.0, "<=", False), (float("nan"), 1.0, ">=", False),
     (None, 1.0, "<=", None), (1.0, None, "<=", None)],
)  # fmt: skip
def test_a_number_holds_only_if_it_is_one(measured, limit, comparison, holds):
    assert Answer("x", Topic.DATA, "x", measured, limit, comparison).holds is holds


def test_the_page_compares_nothing_of_its_own(audits):
    said = document(audits["valid"])
    said["questions"][0] |= {"measured": 99.0, "limit": 1.0, "holds": True}
    layers = ladder(said, read_evidence(audits["valid"]))
    shown = [check for layer in layers for check in layer.checks if check.measured == 99.0]
    assert [check.holds for check in shown] == [True]
