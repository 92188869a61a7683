"""The table at the end of a run: every stage, its verdict, who fell, its time and memory.

Times come from `build/times`, which the stages write outside of everything that is hashed. Only
those are shown that belong to the ladder as it is recorded now: of a run that stands on the runs
below it, or of one that failed after all of them.
"""

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import typer

from gates.overrides import apart
from gates.present import present_runs
from gates.proof import STAGE_REQUIRES, Rung
from gates.readable import found_text, limit_text
from gates.report import read_report, stage_of
from gates.verdicts import stopping
from genpolicy.errors import GenpolicyError
from genpolicy.integrity.documents import read_json

TIMES = Path("build/times")
ALWAYS = "task"
"""The stage that every run begins with, also one that changes nothing."""
ENDS = {0: "done", 1: "FAULT", 2: "BAD INPUT", 3: "REFUSED"}
COLUMNS = 80
"""Of a terminal; no line of the table is longer there."""
COLOURS = {
    "PASS": "green", "done": "green", "FAIL": "red", "REFUSED": "red", "FAULT": "red",
    "BAD INPUT": "red", "INCONCLUSIVE": "yellow", "PENDING_REVIEW": "yellow",
}  # fmt: skip


@dataclass(frozen=True)
class Line:
    """One stage.

    Attributes:
        stage: Its name.
        verdict: Verdict of a gate; how the stage ended otherwise; empty where it has not run.
        decided_by: Criterion that decided, or what follows from the verdict.
        seconds: Wall time of its last run, s.
        peak_mib: Largest memory of one of its processes, MiB.
        stopped: Candidates that fail at a gate, each with its first criterion, number and limit.
        overridden: Criteria that the verdict holds to another limit, and what it is without.
    """

    stage: str
    verdict: str
    decided_by: str
    seconds: float | None
    peak_mib: int | None
    stopped: tuple[str, ...] = ()
    overridden: str = ""


def overview(root: Path, rungs: list[Rung]) -> list[Line]:
    """One line per stage, in the order of the ladder."""
    by_stage = {stage_of(rung.gate): rung for rung in rungs}
    recorded = present_runs(root)
    lines = []
    newest_ns = 0
    for stage in STAGE_REQUIRES:
        record = root / TIMES / f"{stage}.json"
        ended, seconds, peak = _last_run(record)
        written_ns = record.stat().st_mtime_ns if record.is_file() else 0
        current = recorded is None or (
            stage in recorded if ended == ENDS[0] else written_ns >= newest_ns
        )
        newest_ns = max(newest_ns, written_ns if stage != ALWAYS else 0)
        if not current:
            ended, seconds, peak = "", None, None
        rung = by_stage.get(stage)
        if rung is None:
            lines.append(Line(stage, ended, "", seconds, peak))
        else:
            decision, overridden = apart(rung.note)
            decided = rung.decided_by or decision
            fell = tuple(_stopped(root, rung))
            lines.append(Line(stage, rung.verdict, decided, seconds, peak, fell, overridden))
    return lines


def _stopped(root: Path, rung: Rung) -> Iterator[str]:
    """Candidates that fail, by a report that was proved: what was refused does not speak."""
    if rung.verdict in ("NOT JUDGED", "REFUSED"):
        return
    report = read_report(root, rung.gate)[0]
    for name, unmet in sorted(stopping(report).items()):
        if unmet:
            held = f"{found_text(unmet[0])}, required {limit_text(unmet[0])}"
            yield f"{name} {unmet[0].verdict}: {unmet[0].id} {held}"


def as_text(lines: list[Line], *, terminal: bool = False, colour: bool = False) -> str:
    """The table in text: a line for each stage, or no line longer than a terminal is wide.

    Args:
        lines: Of the table.
        terminal: Whether a person reads it at once; otherwise each stage has one line, however
            long, for programs that take lines apart.
        colour: Whether verdicts are coloured, and what is overridden is red.
    """
    wide = max([len("stage"), *(len(line.stage) for line in lines)])
    head = f"{'stage':<{wide}} {'verdict':<15} {'time':>8} {'memory':>8}"
    rows = [head if terminal else f"{head}  decided by"]
    for line in lines:
        time = "" if line.seconds is None else f"{line.seconds:.1f} s"
        memory = "" if line.peak_mib is None else f"{line.peak_mib} MiB"
        verdict = painted(line.verdict, wide=15, colour=colour)
        text = f"{line.stage:<{wide}} {verdict} {time:>8} {memory:>8}"
        said = [said for said in (line.decided_by, *line.stopped) if said]
        if terminal:
            rows += [text.rstrip(), *(row for one in said for row in _below(one))]
            rows += [red(row, colour=colour) for row in _below(line.overridden)]
        else:
            said += [red(line.overridden, colour=colour)] if line.overridden else []
            rows.append(f"{text}  {'; '.join(said)}".rstrip())
    total = sum(line.seconds for line in lines if line.seconds is not None)
    rows.append(f"{'':<{wide}} {'':<15} {total:>6.1f} s")
    return "\n".join(rows)


def painted(verdict: str, *, wide: int, colour: bool) -> str:
    """A verdict, or how a stage ended, in its colour where there is colour, and filled up."""
    text = f"{verdict:<{wide}}"
    known = colour and verdict in COLOURS
    return typer.style(text, fg=COLOURS[verdict]) if known else text


def red(text: str, *, colour: bool) -> str:
    """A text in red, where there is colour."""
    return typer.style(text, fg="red") if colour else text


def _below(text: str) -> list[str]:
    """What is said of a stage, below its line; a name that is longer than a line is broken."""
    return textwrap.wrap(text, COLUMNS, initial_indent="  ", subsequent_indent="    ")


def _last_run(path: Path) -> tuple[str, float | None, int | None]:
    """How the stage ended last, its seconds and peak memory; unknown where nothing is recorded."""
    if not path.is_file():
        return "", None, None
    try:
        record = read_json(path)
        return ENDS[record["exit_code"]], float(record["seconds"]), int(record["peak_mib"])
    except (GenpolicyError, KeyError, TypeError, ValueError):
        return "", None, None
