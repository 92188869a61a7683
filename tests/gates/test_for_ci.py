"""JUnit XML and annotations: what keeps the exit code from 0 is red, nothing else is."""

import xml.etree.ElementTree as ET

from test_differences import REPORT
from test_verdicts import criterion

from gates.for_ci import as_github, as_junit, beside, cases
from gates.proof import Rung
from gates.report import Overridden


def rung(verdict, note=""):
    code = 0 if verdict == "PASS" else 3
    return Rung("A", "need", verdict, "", note, "reports/gate_a.json", code)


def report(*criteria):
    return {"A": REPORT.model_copy(update={"criteria": criteria})}


def suites(found):
    return list(ET.fromstring(as_junit(found)))


def test_what_passes_is_a_test_without_a_word():
    found = cases([rung("PASS")], report(criterion("PASS")))
    (suite,) = suites(found)
    assert (suite.get("name"), suite.get("tests"), suite.get("failures")) == ("Gate A", "1", "0")
    assert [child.tag for child in suite[0]] == ["properties"] and suite[0].get(
        "file"
    ) == "reports/gate_a.json"
    assert as_github(found) == ""


def test_every_criterion_that_does_not_hold_is_red():
    kinds = ("FAIL", "INCONCLUSIVE", "PENDING_REVIEW")
    for verdict in kinds:
        found = cases([rung(verdict)], report(criterion("PASS"), criterion(verdict)))
        (suite,) = suites(found)
        assert (suite.get("tests"), suite.get("failures")) == ("2", "1")
        assert [child.get("type") for child in suite[1]] == [None, verdict]
        assert as_github(found).startswith("::error file=reports/gate_a.json,title=Gate A%2C ")


def test_a_candidate_that_fell_beside_one_that_passes_blocks_nothing():
    """The job is green then, so that its list must not be red; and it must not be silent."""
    fell = criterion("FAIL").model_copy(update={"candidate": "flow"})
    found = cases([rung("PASS")], report(criterion("PASS"), fell))
    (suite,) = suites(found)
    assert (suite.get("failures"), suite.get("skipped")) == ("0", "1")
    assert suite[1].get("name").endswith("(flow)") and suite[1][1].tag == "skipped"
    assert as_github(found).startswith("::warning ")


def test_a_reader_is_told_three_digits_and_a_machine_all_of_them():
    told = {"id": "told_share", "question": "How much?", "measured": 0.507708123456,
            "interval": (0.355647, 0.507708123456), "threshold": 0.5}  # fmt: skip
    fell = criterion("INCONCLUSIVE").model_copy(update=told)
    found = cases([rung("INCONCLUSIVE")], report(fell))
    ((test,),) = suites(found)
    assert "How much? 35.6 to 50.8 %, required <= 50 %" in test[1].get("message")
    assert "35.6 to 50.8 %25, required <= 50 %25" in as_github(found)
    assert {one.get("name"): float(one.get("value")) for one in test[0]} == {
        "measured": 0.507708123456, "low": 0.355647, "high": 0.507708123456, "limit": 0.5,
    }  # fmt: skip


def test_a_report_that_is_not_there_or_not_true_is_one_red_test():
    for verdict in ("NOT JUDGED", "REFUSED"):
        found = cases([rung(verdict, "edited")], report(criterion("PASS")))
        ((test,),) = suites(found)
        assert (test.get("name"), test[0].get("type")) == ("report", verdict)
        assert test[0].get("message") == "edited"


def test_what_blocks_beside_the_gates_is_red_by_itself():
    found = [*cases([rung("PASS")], report(criterion("PASS"))), beside("page", "other", "p.html")]
    last = suites(found)[-1]
    assert (last.get("name"), last.get("failures")) == ("Beside the gates", "1")
    assert (
        as_github(found) == "::error file=p.html,title=Beside the gates%2C page%3A REFUSED::other"
    )


def test_no_text_breaks_out_of_its_line():
    found = [beside("a,b", "100 %\n::error::forged <x>", "p")]
    assert as_github(found).count("\n") == 0
    assert "title=Beside the gates%2C a%2Cb%3A REFUSED::100 %25%0A::error" in as_github(found)
    assert suites(found)[0][0][0].get("message") == "100 %\n::error::forged <x>"


def test_golden_what_both_machines_are_told():
    """One that holds, one that fell beside it, one that is not there, and a page; by hand."""
    fell = criterion("FAIL", "flow", "y").model_copy(update={"caveat": "late"})
    missing = Rung("B", "reproducibility", "NOT JUDGED", "", "no report", "reports/gate_b.json", 3)
    found = [*cases([rung("PASS"), missing], report(criterion("PASS"), fell)),
             beside("page", "another", "p.html")]  # fmt: skip
    assert as_junit(found).splitlines()[1:] == [
        '<testsuites name="genpolicy">',
        '  <testsuite name="Gate A" tests="2" failures="0" skipped="1">',
        '    <testcase classname="Gate A" name="x" file="reports/gate_a.json">',
        "      <properties>",
        '        <property name="measured" value="1.0" />',
        '        <property name="limit" value="1.0" />',
        "      </properties>",
        "    </testcase>",
        '    <testcase classname="Gate A" name="y (flow)" file="reports/gate_a.json">',
        "      <properties>",
        '        <property name="measured" value="1.0" />',
        '        <property name="limit" value="1.0" />',
        "      </properties>",
        '      <skipped message="FAIL: ? 1, required &lt;= 1 (late)" />',
        "    </testcase>",
        "  </testsuite>",
        '  <testsuite name="Gate B" tests="1" failures="1" skipped="0">',
        '    <testcase classname="Gate B" name="report" file="reports/gate_b.json">',
        '      <failure type="NOT JUDGED" message="no report" />',
        "    </testcase>",
        "  </testsuite>",
        '  <testsuite name="Beside the gates" tests="1" failures="1" skipped="0">',
        '    <testcase classname="Beside the gates" name="page" file="p.html">',
        '      <failure type="REFUSED" message="another" />',
        "    </testcase>",
        "  </testsuite>",
        "</testsuites>",
    ]
    assert as_github(found).splitlines() == [
        "::warning file=reports/gate_a.json,title=Gate A%2C y (flow)%3A FAIL"
        "::? 1, required <= 1 (late)",
        "::error file=reports/gate_b.json,title=Gate B%2C report%3A NOT JUDGED::no report",
        "::error file=p.html,title=Beside the gates%2C page%3A REFUSED::another",
    ]


def _overridden(**changes):
    values = {
        "gate": "A", "criterion": "x", "candidate": None, "comparison": "<=", "threshold": 1.0,
        "limit": 2.0, "by": "rita", "reason": "r", "expires": "2026-12-24", "verdict": "FAIL",
        "instead": "PASS", "without": "FAIL",
    }  # fmt: skip
    return Overridden(**{**values, **changes})


def test_what_holds_by_an_exception_blocks_nothing_and_what_else_fails_does():
    other = criterion("FAIL").model_copy(update={"id": "other"})
    held = report(criterion("FAIL"), other)
    held["A"] = held["A"].model_copy(update={"overrides": (_overridden(),)})
    found = cases([rung("FAIL")], held)
    assert {c.name: c.blocks for c in found} == {
        "overridden at gate A: x": False, "x": False, "other": True,
    }  # fmt: skip


def test_a_gate_that_something_beside_its_criteria_keeps_from_passing_is_red():
    held = report(criterion("FAIL"))
    held["A"] = held["A"].model_copy(
        update={"overrides": (_overridden(),), "diagnosis": "No criterion decided."}
    )
    *_, last = cases([rung("INCONCLUSIVE")], held)
    assert (last.name, last.text, last.blocks) == ("report", "No criterion decided.", True)


def test_each_exception_is_a_test_of_its_own():
    entries = tuple(
        _overridden(gate=gate, candidate=who) for gate in "AB" for who in (None, "flow", "act")
    )
    held = {"A": REPORT.model_copy(update={"criteria": (), "overrides": entries})}
    names = [case.name for case in cases([rung("PASS")], held)]
    assert len(set(names)) == 6 and "overridden at gate B: x (flow)" in names
