"""How often is the audit right? Data sets with planted causes, and what it says of each.

    python -m benchmarks.audit --seeds development --quick --out build/audit-benchmark

Writes `results.json` (every data set) and `table.md` (what docs/audit-accuracy.md shows).
"""

import argparse
import json
import time
from pathlib import Path

from benchmarks.audit.cases import CAUSES
from benchmarks.audit.runner import Job, Result, run
from benchmarks.audit.tables import markdown
from genpolicy.compute import LOCAL, map_shards

# Development seeds were looked at while the audit was written; report seeds were not.
FIRST_SEED = {"development": 1_000, "report": 900_000}


def jobs(seeds: str, *, repeats: int, tasks: list[str], only: str) -> list[Job]:
    """Every cause at every strength in every task; twice as often from the minimum on."""
    found = []
    for number, cause in enumerate(CAUSES):
        if only not in cause.name:
            continue
        for place, strength in enumerate(cause.strengths):
            for task in tasks:
                for k in range(repeats * (2 if cause.strong(strength) else 1)):
                    offset = 10_000 * (task == "insertion") + 100 * place + 1_000 * 20 * number + k
                    found.append(Job(number, strength, task, FIRST_SEED[seeds] + offset))
    return found


def main() -> None:
    """Run the benchmark and write its tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.audit", description=__doc__)
    parser.add_argument("--seeds", choices=sorted(FIRST_SEED), default="development")
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--tasks", nargs="+", default=["planar", "insertion"])
    parser.add_argument("--only", default="", help="causes whose name holds this text")
    parser.add_argument("--quick", action="store_true", help="the planar task only")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    tasks = ["planar"] if options.quick else options.tasks
    todo = jobs(options.seeds, repeats=options.repeats, tasks=tasks, only=options.only)
    begin = time.perf_counter()
    results: list[Result] = map_shards(run, todo, workers=options.workers, scheduler=LOCAL)
    wall_s = time.perf_counter() - begin
    options.out.mkdir(parents=True, exist_ok=True)
    rows = [result.as_row() for result in results]
    (options.out / "results.json").write_text(json.dumps(rows, indent=1) + "\n")
    text = markdown(results, seeds=options.seeds)
    (options.out / "table.md").write_text(text)
    print(text)
    cpu_s = sum(result.cpu_s for result in results)
    print(f"{len(results)} data sets in {wall_s:.0f} s, {cpu_s:.0f} s of processor time")


if __name__ == "__main__":
    main()
