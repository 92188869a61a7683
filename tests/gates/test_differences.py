"""The first place where two reports differ is named, with both values in short."""

import pytest
from test_verdicts import criterion

from gates.differences import first_difference
from gates.report import GateReport

REPORT = GateReport(
    schema_version=1, gate="A", verdict="PASS", candidates={}, criteria=(criterion("PASS"),),
    materials={"a": "1", "b": "2"}, upstream={}, code={}, parameters={}, pipeline={}, settings={},
    environment={}, caveats=("one", "two"), diagnosis="", decision="Go on.", promoted=None,
)  # fmt: skip


def found(**changes):
    return first_difference(REPORT, REPORT.model_copy(update=changes))


def test_the_same_report_has_no_difference():
    assert found() is None


@pytest.mark.parametrize(
    ("changes", "difference"),
    [
        ({"promoted": "flow"}, (".promoted", "null", '"flow"')),
        ({"decision": "Stop.", "verdict": "FAIL"}, (".decision", '"Go on."', '"Stop."')),
        ({"decision": "Stop.", "caveats": ()}, (".caveats", "a list of 2", "a list of 0")),
        ({"caveats": ("one", "2")}, (".caveats[1]", '"two"', '"2"')),
        ({"caveats": ("1", "2")}, (".caveats[0]", '"one"', '"1"')),
        ({"materials": {"a": "1"}}, (".materials.b", '"2"', "null")),
        ({"materials": {"a": "1", "b": "2", "c": "3"}}, (".materials.c", "null", '"3"')),
        ({"materials": {"a": "3", "b": "3"}}, (".materials.a", '"1"', '"3"')),
        ({"settings": {"n": None}}, (".settings.n", "null", "null")),
        ({"criteria": (criterion("FAIL"),)}, (".criteria[0].verdict", '"PASS"', '"FAIL"')),
    ],
)
def test_the_first_difference_is_named(changes, difference):
    assert found(**changes) == difference


@pytest.mark.parametrize(("length", "said"), [(58, 60), (59, 60), (500, 60)])
def test_a_long_value_is_cut_where_it_is_longer_than_sixty(length, said):
    """With its quotation marks a text of 58 is sixty long, and stands whole."""
    _, _, derived = found(decision="x" * length)
    assert len(derived) == said and derived.endswith("…") == (length > 58)
    assert derived.startswith('"xxx')
