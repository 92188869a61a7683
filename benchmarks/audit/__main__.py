r"""How often is the audit right? Data sets with planted causes, and what it says of each.

    python -m benchmarks.audit --seeds development --quick --out build/audit-benchmark
    python -m benchmarks.audit --seeds report --out build/audit-benchmark \
        --docs docs/audit-accuracy.md

Writes `results.json` (every data set) and `table.md` (what docs/audit-accuracy.md shows). With
`--sample n` at most n data sets of each cause in each task from its minimum on, and n below. A run
that was stopped goes on where it stopped, and so does a larger sample.
"""

import argparse
import json
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from benchmarks.audit.cases import CAUSES
from benchmarks.audit.frozen import frozen_commit, report_seed
from benchmarks.audit.runner import Job, Result, run
from benchmarks.audit.tables import into_page, markdown
from genpolicy.compute import LOCAL, map_shards
from genpolicy.seeds import stream

# Development seeds were looked at while the audit was written. Report seeds follow from the commit.
DEVELOPMENT, REPORT = "development", "report"
FIRST_DEVELOPMENT_SEED = 1_000
# Results are written after so many data sets.
BLOCK = 16


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


def sampled(found: Sequence[Job], root_seed: int, largest: int | None) -> list[Job]:
    """Jobs in random order, of which each part is a fair sample; at most so many of each kind.

    Kinds are a cause in one task from its minimum on, and a cause below it.

    Args:
        found: All jobs.
        root_seed: Seed of the order.
        largest: None takes all of them.
    """
    order = stream(root_seed, "sample").permutation(len(found)).tolist()
    kinds: dict[tuple[int, str], int] = defaultdict(int)
    ranked = []
    for job in (found[place] for place in order):
        strong = CAUSES[job.cause].strong(job.strength)
        kind = (job.cause, job.task if strong else "below")
        ranked.append((kinds[kind], job))
        kinds[kind] += 1
    ranked.sort(key=lambda item: item[0])
    return [job for rank, job in ranked if largest is None or rank < largest]


def measured(todo: Sequence[Job], file: Path, *, workers: int) -> list[Result]:
    """Results of all jobs; those that the file holds already are not measured again."""
    rows = json.loads(file.read_text()) if file.exists() else []
    known = {result.job: result for result in map(Result.from_row, rows)}
    missing = [job for job in todo if job not in known]
    for first in range(0, len(missing), BLOCK):
        block = missing[first : first + BLOCK]
        for result in map_shards(run, block, workers=workers, scheduler=LOCAL):
            known[result.job] = result
        done = [known[job].as_row() for job in todo if job in known]
        file.write_text(json.dumps(done, indent=1) + "\n")
        strong = [result for result in known.values() if result.strong and result.job in todo]
        right = sum(result.right for result in strong)
        print(
            f"{len(done)} of {len(todo)} data sets, right in {right} of {len(strong)} from the "
            "minimum strength on",
            flush=True,
        )
    return [known[job] for job in todo]


def main() -> None:
    """Run the benchmark and write its tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.audit", description=__doc__)
    parser.add_argument("--seeds", choices=(DEVELOPMENT, REPORT), default=DEVELOPMENT)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--tasks", nargs="+", default=["planar", "insertion"])
    parser.add_argument("--sample", type=int, help="data sets of each kind, at most")
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
    todo = sampled(todo, first, options.sample)
    begin = time.perf_counter()
    options.out.mkdir(parents=True, exist_ok=True)
    results = measured(todo, options.out / "results.json", workers=options.workers)
    wall_s = time.perf_counter() - begin
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
