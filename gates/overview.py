"""The table at the end of a run: every stage, its verdict, what decided, its time and memory.

Times come from `build/times`, which the stages write outside of everything that is hashed. Only
those are shown that belong to the ladder as it is recorded now: of a run that stands on the runs
below it, or of one that failed after all of them.
"""

from dataclasses import dataclass
from pathlib import Path

from gates.present import present_runs
from gates.proof import STAGE_REQUIRES, Rung
from gates.report import stage_of
from genpolicy.errors import GenpolicyError
from genpolicy.integrity.documents import read_json

TIMES = Path("build/times")
ALWAYS = "task"
"""The stage that every run begins with, also one that changes nothing."""
ENDS = {0: "done", 1: "FAULT", 2: "BAD INPUT", 3: "REFUSED"}


@dataclass(frozen=True)
class Line:
    """One stage.

    Attributes:
        stage: Its name.
        verdict: Verdict of a gate; how the stage ended otherwise; empty where it has not run.
        decided_by: Criterion that decided, or what follows from the verdict.
        seconds: Wall time of its last run, s.
        peak_mib: Largest memory of one of its processes, MiB.
    """

    stage: str
    verdict: str
    decided_by: str
    seconds: float | None
    peak_mib: int | None


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
            lines.append(Line(stage, rung.verdict, rung.decided_by or rung.note, seconds, peak))
    return lines


def as_text(lines: list[Line]) -> str:
    """The table for a terminal."""
    wide = max([len("stage"), *(len(line.stage) for line in lines)])
    rows = [f"{'stage':<{wide}} {'verdict':<15} {'time':>8} {'memory':>8}  decided by"]
    for line in lines:
        time = "" if line.seconds is None else f"{line.seconds:.1f} s"
        memory = "" if line.peak_mib is None else f"{line.peak_mib} MiB"
        text = f"{line.stage:<{wide}} {line.verdict:<15} {time:>8} {memory:>8}  {line.decided_by}"
        rows.append(text.rstrip())
    total = sum(line.seconds for line in lines if line.seconds is not None)
    rows.append(f"{'':<{wide}} {'':<15} {total:>6.1f} s")
    return "\n".join(rows)


def _last_run(path: Path) -> tuple[str, float | None, int | None]:
    """How the stage ended last, its seconds and peak memory; unknown where nothing is recorded."""
    if not path.is_file():
        return "", None, None
    try:
        record = read_json(path)
        return ENDS[record["exit_code"]], float(record["seconds"]), int(record["peak_mib"])
    except (GenpolicyError, KeyError, TypeError, ValueError):
        return "", None, None
