"""What the README says of the default ladder, made from the reports that lie in the repository.

`python tests/contracts/readme.py --write` puts it between its two marks, and draws what a terminal
shows; the contract tests hold both there: a number that a report does not say any more cannot stay.
"""

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2]))

import terminal

from flows.estimate import DOCUMENTED
from gates.overview import Line, as_text
from gates.report import GateReport, stage_of
from gates.verdicts import decided_text
from gates.words import advice_of

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
PICTURE = Path("docs/pictures/terminal.svg")
BEGIN, END = "<!-- from reports/: begin -->\n", "<!-- from reports/: end -->\n"
SHOT_BEGIN, SHOT_END = "<!-- of a run: begin -->\n", "<!-- of a run: end -->\n"
GATES = "ABCDE"
TOLD = {
    "A": ("multimodal_situations", "mean_defeated_share", "told_share", "chunking_valid_share",
          "factor_valid_share", "remedy_valid_share", "latent_dependence_p",
          "baseline_mode_coverage"),
}  # fmt: skip
"""Criteria that a newcomer wants to see of a gate, held or not; of the others those that do not."""
VERDICTS = {"PASS": "holds", "FAIL": "does not hold", "INCONCLUSIVE": "open",
            "PENDING_REVIEW": "waits for people"}  # fmt: skip


def reports(folder: Path = ROOT / "reports") -> dict[str, dict]:
    """The reports that lie in a folder, by their gate."""
    found = {}
    for gate in GATES:
        path = folder / f"gate_{gate.lower()}.json"
        if path.is_file():
            found[gate] = json.loads(path.read_text())
    return found


def section(found: dict[str, dict]) -> str:
    """What stands between the marks."""
    return "\n".join(line for gate, report in found.items() for line in _of_gate(gate, report))


def _of_gate(gate: str, report: dict) -> list[str]:
    criteria = report["criteria"]
    holding = [item for item in criteria if item["verdict"] == "PASS"]
    following = advice_of(report["diagnosis"])
    lines = [
        f"**Gate {gate} is {report['verdict']}**: {len(holding)} of {len(criteria)} criteria hold.",
        f"{report['decision']} {following}".rstrip(),
        "",
        "| criterion | asks | found | allowed | |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| `{item['id']}`{_whose(item)} | {item['question']} | {_found(item)} "
        f"| {item['comparison'].replace('<=', '≤').replace('>=', '≥')} "
        f"{number(item['threshold'], item['id'])} | {VERDICTS[item['verdict']]} |"
        for item in criteria
        if item["verdict"] != "PASS" or item["id"] in TOLD.get(gate, ())
    ]
    return [*lines, ""]


def _whose(item: dict) -> str:
    return f" of {item['candidate']}" if item["candidate"] else ""


def _found(item: dict) -> str:
    """The number that was judged, the interval around it, and of how many."""
    said = "not measured" if item["measured"] is None else number(item["measured"], item["id"])
    if item["interval"]:
        low, high = (number(end, item["id"]) for end in item["interval"])
        said += f" ({low} to {high})"
    return said + (f", {item['counted']}" if item["counted"] else "")


def number(value: float, name: str) -> str:
    """A number with three digits, a share as percent."""
    if name.endswith(("_share", "_coverage")):
        return f"{100 * value:.3g} %"
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:,.0f}"


def run(found: dict[str, dict]) -> str:
    """How long a run takes, as the program says before one, and what a terminal shows behind it."""
    _, _, takes = DOCUMENTED.partition(". ")
    return "\n".join([f"{takes}.", "", f"![{title(found)}]({PICTURE})", ""])


def shown(found: dict[str, dict], *, colour: bool = False) -> list[str]:
    """What a terminal shows of the gates, as the program prints it.

    Without the other stages, and without the columns of time and memory: what a machine took is
    in no report.
    """
    lines = [_line(gate, found.get(gate)) for gate in GATES]
    *table, _sum_of_no_times = as_text(lines, terminal=True, colour=colour).splitlines()
    head, *rows = table
    return ["$ genpolicy gates summary", head.partition(" time")[0].rstrip(), *rows]


def title(found: dict[str, dict]) -> str:
    """What the picture shows, for who does not see it."""
    said = (f"{gate} {found[gate]['verdict'] if gate in found else 'NOT JUDGED'}" for gate in GATES)
    return f"The end of a run in a terminal: {', '.join(said)}"


def picture(found: dict[str, dict]) -> str:
    """The same as a picture, in the colours of a terminal."""
    return terminal.drawn(shown(found, colour=True), title=title(found))


def _line(gate: str, report: dict | None) -> Line:
    if report is None:
        return Line(stage_of(gate), "NOT JUDGED", "", None, None)
    read = GateReport.model_validate_json(json.dumps(report))
    return Line(stage_of(gate), read.verdict, decided_text(read) or read.decision, None, None)


def placed(text: str, made: str, begins: str = BEGIN, ends: str = END) -> str:
    """A text with what is made between its marks.

    Raises:
        ValueError: A mark is missing.
    """
    before, begin, rest = text.partition(begins)
    _, end, after = rest.partition(ends)
    if not begin or not end:
        raise ValueError(f"no {begins.strip()} and {ends.strip()}")
    return before + begin + made + end + after


def whole(text: str, found: dict[str, dict]) -> str:
    """The README with all that is made of these reports."""
    return placed(placed(text, section(found)), run(found), SHOT_BEGIN, SHOT_END)


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit("usage: python tests/contracts/readme.py --write")
    README.write_text(whole(README.read_text(), reports()))
    (ROOT / PICTURE).write_text(picture(reports()))
