"""`genpolicy diagnose`: where to look first. Registered in `genpolicy.commands`."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from genpolicy.cli.shell import AsJson, with_examples
from genpolicy.errors import BadInputError

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

    Exit 0 if every answer has its numbers and nothing speaks (what no stage records
    is unknown all the same), 3 if something speaks, is red or
    not decided, or a report is untrue, 2 if a report cannot be read or an answer
    waits for a gate that is not judged: what builds it is said.
    """
    from gates.diagnosis.reports import read_reports, require_candidates
    from gates.diagnosis.symptoms import symptoms_of

    if checkpoints and (symptom or candidate):
        raise BadInputError(
            where="--checkpoints",
            found="--symptom" if symptom else "--candidate",
            expected="the rows alone: they are about everybody, and about no symptom",
            action="Leave one of them out.",
        )
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

    found = [walk(reports, name) for name in names]
    if as_json:
        rows = [
            _row(one, "whole") | {"ended_at": one.ended_at.place if one.ended_at else None}
            for one in found
        ]
        _print(reports, "walks", rows)
    else:
        texts = (gates_text(reports), *map(walk_text, found), symptoms_text(SYMPTOMS))
        print("\n\n".join(texts))
    spoken = any(one.ended_at for one in found)
    return _code(reports, spoken=spoken, whole=all(one.whole for one in found))


def _symptoms(reports: Any, asked: Any, names: tuple[str, ...], as_json: bool) -> int:
    from gates.diagnosis.printed import answered_text, gates_text
    from gates.diagnosis.symptoms import answered

    found = [answered(symptom, reports, name) for symptom in asked for name in names]
    if as_json:
        rows = [_row(one, "found", "undecided", "answerable") for one in found]
        _print(reports, "answers", rows)
    else:
        print("\n\n".join([gates_text(reports), *map(answered_text, found)]))
    spoken = any(one.found or one.undecided or one.before_all for one in found)
    return _code(reports, spoken=spoken, whole=all(one.answerable for one in found))


def _checkpoints(reports: Any, as_json: bool) -> int:
    from gates.diagnosis.checkpoints import NOT_JUDGED, UNMATCHED, ruled
    from gates.diagnosis.printed import checkpoints_text, gates_text

    rows = ruled(reports)
    if as_json:
        _print(reports, "rows", [_row(one) for one in rows])
    else:
        print(f"{gates_text(reports)}\n\n{checkpoints_text(rows)}")
    verdicts = {row.verdict for row in rows}
    spoken = bool(verdicts - {"PASS", NOT_JUDGED, UNMATCHED})
    return _code(reports, spoken=spoken, whole=verdicts == {"PASS"})


def _code(reports: Any, *, spoken: bool, whole: bool) -> int:
    """What is untrue or speaks, by the precedence of all gates; else whether all was answered."""
    from gates.printed import worst

    return worst({reports.untrue, 3 if spoken else 0}) or (0 if whole else 2)


def _row(one: Any, *derived: str) -> dict[str, Any]:
    """A result as a dictionary, with what follows from it."""
    return asdict(one) | {name: getattr(one, name) for name in derived}


def _print(reports: Any, what: str, rows: list[dict[str, Any]]) -> None:
    """Results as JSON, with the reports that they stand on."""
    from gates.printed import print_document

    proved = {gate: report.verdict for gate, report in reports.judged.items()}
    print_document({"proved": proved, "missing": dict(reports.missing), what: rows})
