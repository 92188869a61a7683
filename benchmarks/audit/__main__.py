r"""How often is the audit right? Data sets with planted causes, and what it says of each.

    python -m benchmarks.audit --seeds development --quick --out build/audit-benchmark
    python -m benchmarks.audit --seeds report --out build/audit-benchmark \
        --docs docs/audit-accuracy.md

Writes `results.json` (every data set) and `table.md` (what docs/audit-accuracy.md shows).
"""

import argparse
import json
import time
from pathlib import Path

from benchmarks.audit.cases import CAUSES
from benchmarks.audit.frozen import frozen_commit, report_seed
from benchmarks.audit.runner import Job, Result, run
from benchmarks.audit.tables import into_page, markdown
from genpolicy.compute import LOCAL, map_shards

# Development seeds were looked at while the audit was written. Report seeds follow from the commit.
DEVELOPMENT, REPORT = "development", "report"
FIRST_DEVELOPMENT_SEED = 1_000


def jobs(first_seed: int, *, repeats: int, tasks: list[str], only: str) -> list[Job]:
    """Every cause at every strength.

    From the minimum strength on in every task, twice, and three times where nothing is wrong with
    data or labels, since only there a need can be claimed by the layers that follow; below it once,
    in one task after the other.
    """
    found = []
    for number, cause in enumerate(CAUSES):
        for place, strength in enumerate(cause.strengths):
            strong = cause.strong(strength)
            times = repeats * (1 if not strong else 2 if cause.group.startswith("data") else 3)
            for turn, task in enumerate(tasks):
                if strong or turn == (number + place) % len(tasks):
                    # Each data set has its own seed, whatever else is run.
                    offset = 20_000 * number + 10_000 * (task == "insertion") + 100 * place
                    seed = first_seed + offset
                    found += [Job(number, strength, task, seed + k) for k in range(times)]
    return [job for job in found if only in CAUSES[job.cause].name]


def main() -> None:
    """Run the benchmark and write its tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.audit", description=__doc__)
    parser.add_argument("--seeds", choices=(DEVELOPMENT, REPORT), default=DEVELOPMENT)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--tasks", nargs="+", default=["planar", "insertion"])
    parser.add_argument("--only", default="", help="causes whose name holds this text")
    parser.add_argument("--quick", action="store_true", help="the planar task only")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--docs", type=Path, help="page between whose marks the tables go")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    seeds, first = options.seeds, FIRST_DEVELOPMENT_SEED
    if seeds == REPORT:
        commit = frozen_commit()
        seeds, first = f"report seeds of commit {commit}", report_seed(commit)
    tasks = ["planar"] if options.quick else options.tasks
    todo = jobs(first, repeats=options.repeats, tasks=tasks, only=options.only)
    begin = time.perf_counter()
    results: list[Result] = map_shards(run, todo, workers=options.workers, scheduler=LOCAL)
    wall_s = time.perf_counter() - begin
    options.out.mkdir(parents=True, exist_ok=True)
    rows = [result.as_row() for result in results]
    (options.out / "results.json").write_text(json.dumps(rows, indent=1) + "\n")
    text = markdown(results, seeds=seeds)
    (options.out / "table.md").write_text(text)
    if options.docs:
        into_page(options.docs, text)
    print(text)
    cpu_s = sum(result.cpu_s for result in results)
    print(
        f"{len(results)} data sets in {wall_s:.0f} s on {options.workers} processes, "
        f"{cpu_s:.0f} s of processor time"
    )


if __name__ == "__main__":
    main()
