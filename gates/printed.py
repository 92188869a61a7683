"""What the commands of the gates print, and the exit codes of what blocks beside the gates."""

import dataclasses
import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gates.card.history import require_said_by_themselves, unknown_history
from gates.card.people import load_allow_list
from gates.for_ci import as_github, as_junit, beside, cases
from gates.overriders import require_in_force
from gates.overrides import OVERRIDES, apart
from gates.overview import painted, red
from gates.proof import Rung
from gates.report import GATES, Gate, read_report, report_path, stage_of
from gates.writing import INDEX, changed_page
from genpolicy.errors import GenpolicyError

Problem = tuple[str, str, str, int]
"""What blocks beside the gates: its name, a sentence, its file, an exit code."""
NOT_BUILT = "not built: make ladder"
ARTIFACTS = "artifacts"


def not_built(root: Path, rungs: Sequence[Rung]) -> str:
    """Said in place of empty rows where no stage has run here; empty where one has.

    A clone brings reports without the evidence under them, of which nothing can be proved.

    Args:
        root: Repository root.
        rungs: Every gate, as proved.
    """
    folder = root / ARTIFACTS
    verdicts = {rung.verdict for rung in rungs}
    if not verdicts <= {"NOT JUDGED", "REFUSED"} or (folder.is_dir() and any(folder.iterdir())):
        return ""
    if "REFUSED" not in verdicts:
        return NOT_BUILT
    return f"{NOT_BUILT} (reports lie here without their evidence, and nothing of it is proved)"


def coloured() -> bool:
    """Whether standard output is a terminal whose user wants colour (https://no-color.org)."""
    return sys.stdout.isatty() and not os.environ.get("NO_COLOR")


def pages_code(root: Path) -> set[int]:
    """Exit code of a printed page that says other than the reports; none where all say the same."""
    problem = page_problem(root)
    if problem is None:
        return set()
    print(problem[1], file=sys.stderr)
    return {problem[3]}


def problems_beside(root: Path, rungs: Sequence[Rung]) -> list[Problem]:
    """What blocks although every gate passes: a page, a limit that is overridden no longer.

    Or one that somebody overrides in the name of another; where git knows nothing, that is
    printed.

    Args:
        root: Repository root.
        rungs: The gates that are asked for, as proved.
    """
    found = [page_problem(root)]
    proved = _proved(rungs)
    try:
        reports = {gate: read_report(root, gate)[0] for gate in proved}
        require_in_force(root, reports)
        if any(report.overrides for report in reports.values()):
            if unknown := unknown_history(root)[0]:
                text = f"{OVERRIDES}: who committed it is not known: the repository is {unknown}."
                print(text, file=sys.stderr)
            else:
                require_said_by_themselves(root, load_allow_list(root))
    except GenpolicyError as error:
        found.append(("override", str(error), OVERRIDES, error.exit_code))
    return [problem for problem in found if problem is not None]


def _proved(rungs: Sequence[Rung]) -> list[Gate]:
    """Gates whose report was proved, whatever it says."""
    return [rung.gate for rung in rungs if rung.verdict not in ("NOT JUDGED", "REFUSED")]


def page_problem(root: Path) -> Problem | None:
    """A page that says other than the reports, or that cannot be made; None if all agree."""
    try:
        page = changed_page(root)
    except GenpolicyError as error:
        return "page", str(error), INDEX, error.exit_code
    if not page:
        return None
    text = (
        f"{page} is another page, expected the one that the reports give. Run "
        f"`{_printing(page)}`, which prints it again; never edit a page."
    )
    return "page", text, page, 3


def _printing(page: str) -> str:
    """The command that prints a page again: of a gate its stage, of the first page any of them."""
    for gate in GATES:
        if page.startswith(report_path(gate).removesuffix(".json")):
            return f"dvc repro -f {stage_of(gate)}"
    return "python -m gates.writing"


def print_cases(
    root: Path, rungs: Sequence[Rung], problems: Sequence[Problem], layout: str
) -> None:
    """Every criterion, and what blocks beside the gates, as JUnit XML or for GitHub."""
    proved = _proved(rungs)
    found = cases(rungs, {gate: read_report(root, gate)[0] for gate in proved})
    found += [beside(name, text, file) for name, text, file, _ in problems]
    print(as_junit(found) if layout == "junit" else as_github(found))


def worst(codes: set[int]) -> int:
    """The exit code of several: what cannot be read comes before what is refused."""
    return 2 if 2 in codes else max(codes, default=0)


def print_rungs(rungs: Sequence[Rung], as_json: bool) -> None:
    """A line for each gate, or JSON."""
    if as_json:
        print_rows(rungs)
        return
    wide = max(len(rung.name) for rung in rungs)
    for rung in rungs:
        verdict = painted(rung.verdict, wide=14, colour=coloured())
        name = f"{rung.gate}  {rung.name:<{wide}}  {verdict}"
        decision, overridden = apart(rung.note)
        said = [rung.decided_by or decision]
        said += [red(overridden, colour=coloured())] if overridden else []
        print(f"{name}  {' '.join(said)}".rstrip())


def print_rows(rows: Sequence[Any]) -> None:
    """Dataclasses as JSON."""
    print_document([dataclasses.asdict(row) for row in rows])


def print_document(document: Mapping[str, Any] | list[dict[str, Any]]) -> None:
    """A document as JSON."""
    print(json.dumps(document, indent=2, ensure_ascii=False))
