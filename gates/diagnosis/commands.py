"""`genpolicy diagnose`: where to look first. Registered in `genpolicy.commands`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from genpolicy.cli.shell import AsJson, with_examples

Root = Annotated[Path, typer.Option(help="Repository root.")]


@with_examples(
    "genpolicy diagnose",
    "genpolicy diagnose --symptom boundary-jump --candidate flow",
    "genpolicy diagnose --checkpoints",
)
def diagnose(
    symptom: Annotated[
        str, typer.Option(metavar="NAME", help="What you see; a wrong name lists them; or all.")
    ] = "",
    candidate: Annotated[str, typer.Option(help="Whose; everybody if absent.")] = "",
    checkpoints: Annotated[
        bool, typer.Option("--checkpoints", help="The nine checkpoint rows, by owner.")
    ] = False,
    root: Root = Path(),
    as_json: AsJson = False,
) -> int:
    """Say where to look first.

    Proves every report, then goes through data, modes, conditioning, training,
    sampler, timing, feasibility, contact and evaluator, in this order, and stops
    at the first that is not in order: what lies behind it is not asked. With a
    symptom it makes the chapter's two inspections and says what was found, what
    is not known, where to look now and what not to conclude.

    Exit 0 if nothing speaks, 3 if something does or a report is untrue, 2 if
    nothing can be answered: what builds the missing reports is said.
    """
    from gates.diagnosis.reports import read_reports, require_candidates
    from gates.diagnosis.symptoms import symptoms_of

    asked = symptoms_of(symptom) if symptom else ()
    reports = read_reports(root)
    names = require_candidates(reports, candidate)
    if checkpoints:
        return _checkpoints(reports, as_json)
    if asked:
        return _symptoms(reports, asked, names, as_json)
    return _walks(reports, names, as_json)


def _walks(reports: Any, names: tuple[str, ...], as_json: bool) -> int:
    from gates.diagnosis.printed import gates_text, symptoms_text, walk_text
    from gates.diagnosis.symptoms import SYMPTOMS
    from gates.diagnosis.walk import walk
    from gates.printed import print_rows

    found = [walk(reports, name) for name in names]
    if as_json:
        print_rows(found)
    else:
        texts = (gates_text(reports), *map(walk_text, found), symptoms_text(SYMPTOMS))
        print("\n\n".join(texts))
    if reports.untrue or any(one.ended_at for one in found):
        return reports.untrue or 3
    return 0 if all(one.whole for one in found) else 2


def _symptoms(reports: Any, asked: Any, names: tuple[str, ...], as_json: bool) -> int:
    from gates.diagnosis.printed import answered_text, gates_text
    from gates.diagnosis.symptoms import answered
    from gates.printed import print_rows

    found = [answered(symptom, reports, name) for symptom in asked for name in names]
    if as_json:
        print_rows(found)
    else:
        print("\n\n".join([gates_text(reports), *map(answered_text, found)]))
    if reports.untrue or any(one.found for one in found):
        return reports.untrue or 3
    return 0 if any(one.answerable for one in found) else 2


def _checkpoints(reports: Any, as_json: bool) -> int:
    from gates.diagnosis.checkpoints import NOT_JUDGED, ruled
    from gates.diagnosis.printed import checkpoints_text, gates_text
    from gates.printed import print_rows

    rows = ruled(reports)
    if as_json:
        print_rows(rows)
    else:
        print(f"{gates_text(reports)}\n\n{checkpoints_text(rows)}")
    verdicts = {row.verdict for row in rows}
    if reports.untrue or verdicts - {"PASS", NOT_JUDGED}:
        return reports.untrue or 3
    return 2 if NOT_JUDGED in verdicts else 0
