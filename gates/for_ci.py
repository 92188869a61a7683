"""The state of the ladder for machines that block a merge: JUnit XML, annotations of GitHub.

Whatever keeps the exit code from 0 is a failure here as well: a list that is all green beside a
job that is red would be believed.
"""

import json
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from gates.overrides import OVERRIDDEN, OVERRIDES, said
from gates.proof import Rung
from gates.readable import found_text, limit_text
from gates.report import Answer, Gate, GateReport
from gates.verdicts import counting


@dataclass(frozen=True)
class ListedTest:
    """One question that was put to a gate, as a test in a list.

    Attributes:
        gate: Letter of the gate; empty for what lies beside the gates.
        name: Criterion, with its candidate in brackets; `report` for the report itself.
        state: `PASS`, or why it does not; as the report says it. `OVERRIDDEN` of a limit.
        text: One line for a reader.
        file: Where it stands, relative to the repository.
        blocks: Whether it keeps the ladder from passing. What stopped a candidate beside one that
            passes does not, nor what holds by the limit of an exception.
        numbers: What was measured, the ends of its interval and its limit, each by its name with
            all digits of the report; without what is not there.
    """

    gate: str
    name: str
    state: str
    text: str
    file: str
    blocks: bool
    numbers: tuple[tuple[str, float], ...] = ()


def cases(rungs: Sequence[Rung], reports: Mapping[Gate, GateReport]) -> list[ListedTest]:
    """Every criterion of the proved reports; one case for a gate that has none to show.

    Args:
        rungs: The gates that are asked for, as proved.
        reports: Their reports, as they lie there.
    """
    return [case for rung in rungs for case in _of_rung(rung, reports.get(rung.gate))]


def beside(name: str, text: str, file: str) -> ListedTest:
    """What blocks though every gate passes: a page, the history."""
    return ListedTest("", name, "REFUSED", text, file, blocks=True)


def as_junit(found: Sequence[ListedTest]) -> str:
    """JUnit XML: a suite for each gate, a test for each criterion; skipped what does not block.

    Texts have the digits and units of a person; all digits stand in a test's properties.
    """
    root = ET.Element("testsuites", name="genpolicy")
    for gate in dict.fromkeys(case.gate for case in found):
        own = [case for case in found if case.gate == gate]
        suite = ET.SubElement(root, "testsuite", name=_suite(gate), tests=str(len(own)))
        suite.set("failures", str(sum(case.blocks for case in own)))
        suite.set("skipped", str(sum(_skipped(case) for case in own)))
        for case in own:
            test = ET.SubElement(suite, "testcase", classname=_suite(gate), name=case.name)
            test.set("file", case.file)
            if case.numbers:
                properties = ET.SubElement(test, "properties")
                for name, value in case.numbers:
                    ET.SubElement(properties, "property", name=name, value=json.dumps(value))
            if case.blocks:
                ET.SubElement(test, "failure", type=case.state, message=case.text)
            elif _skipped(case):
                ET.SubElement(test, "skipped", message=f"{case.state}: {case.text}")
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True)


def as_github(found: Sequence[ListedTest]) -> str:
    """Workflow commands: an error for what blocks, a warning for what stopped one candidate."""
    lines = []
    for case in found:
        if case.state != "PASS":
            level = "error" if case.blocks else "warning"
            title = _property(f"{_suite(case.gate)}, {case.name}: {case.state}")
            lines.append(
                f"::{level} file={_property(case.file)},title={title}::{_message(case.text)}"
            )
    return "\n".join(lines)


def _skipped(case: ListedTest) -> bool:
    return not case.blocks and case.state != "PASS"


def _suite(gate: str) -> str:
    return f"Gate {gate}" if gate else "Beside the gates"


def _of_rung(rung: Rung, report: GateReport | None) -> Iterator[ListedTest]:
    if rung.verdict in ("NOT JUDGED", "REFUSED") or report is None:
        yield ListedTest(rung.gate, "report", rung.verdict, rung.note, rung.report, blocks=True)
        return
    for entry in report.overrides:
        of = f" ({entry.candidate})" if entry.candidate else ""
        name = f"overridden at gate {entry.gate}: {entry.criterion}{of}"
        yield ListedTest(rung.gate, name, OVERRIDDEN, said(entry), OVERRIDES, blocks=False)
    stand = {(one.id, one.candidate) for one in counting(report) if one.verdict != "PASS"}
    for answer in report.criteria:
        name = f"{answer.id} ({answer.candidate})" if answer.candidate else answer.id
        broken = answer.verdict != "PASS" and (answer.id, answer.candidate) in stand
        blocks = broken and rung.verdict != "PASS"
        yield ListedTest(
            rung.gate, name, answer.verdict, _text(answer), rung.report, blocks, _numbers(answer)
        )
    if rung.verdict != "PASS" and not stand:  # something else lacks, and keeps it from passing
        text = report.diagnosis or report.decision
        yield ListedTest(rung.gate, "report", rung.verdict, text, rung.report, blocks=True)


def _text(answer: Answer) -> str:
    held = f"{found_text(answer)}, required {limit_text(answer)}"
    return f"{answer.question} {held}{f' ({answer.caveat})' if answer.caveat else ''}"


def _numbers(answer: Answer) -> tuple[tuple[str, float], ...]:
    low, high = answer.interval or (None, None)
    found = {"measured": answer.measured, "low": low, "high": high, "limit": answer.threshold}
    return tuple((name, value) for name, value in found.items() if value is not None)


def _message(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _message(text).replace(":", "%3A").replace(",", "%2C")
