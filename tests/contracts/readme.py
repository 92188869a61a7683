"""What the README says of the default ladder, made from the reports that lie in the repository.

`python tests/contracts/readme.py --write` puts it between its two marks, and the contract tests
hold it there: a number that a report does not say any more cannot stay.
"""

import json
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
BEGIN, END = "<!-- from reports/: begin -->\n", "<!-- from reports/: end -->\n"
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
    _, _, following = report["diagnosis"].partition("Next: ")
    following = f" Next: {following}" if following else ""
    lines = [
        f"**Gate {gate} is {report['verdict']}**: {len(holding)} of {len(criteria)} criteria hold.",
        f"{report['decision']}{following}",
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


def placed(text: str, made: str) -> str:
    """A text with what is made between its marks.

    Raises:
        ValueError: A mark is missing.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"no {BEGIN.strip()} and {END.strip()}")
    return before + begin + made + end + after


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit("usage: python tests/contracts/readme.py --write")
    README.write_text(placed(README.read_text(), section(reports())))
