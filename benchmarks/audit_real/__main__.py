r"""How often is the audit right on recordings as others bring them?

    python -m benchmarks.audit_real --half development --out build/audit-real
    python -m benchmarks.audit_real --half development --only pushing/lag --out build/audit-real
    python -m benchmarks.audit_real --half report --out build/audit-real-report \
        --docs docs/audit-real.md
    python -m benchmarks.audit_real --truth docs/audit-real.md

Writes `results.json` (every recording) and `table.md`. A run that was stopped goes on where it
stopped. The report half is drawn from the hash of the commit, where all is as committed.
"""

import argparse
import json
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from pathlib import Path

from benchmarks.audit.frozen import DETECTOR, frozen_commit, report_seed
from benchmarks.audit_real.catalogue import AS_IS, Case, development, report
from benchmarks.audit_real.runner import Result, run
from benchmarks.audit_real.stated import RESULTS, TRUTH, into_page, truth_tables
from benchmarks.audit_real.tables import SHARES, markdown
from benchmarks.audit_real.truth import RIGHT
from genpolicy.compute import LOCAL, map_shards
from genpolicy.seeds import stream

DEVELOPMENT, REPORT = "development", "report"
FIRST_DEVELOPMENT_SEED = 100


def sampled(cases: Sequence[Case], root_seed: int, largest: int | None) -> list[Case]:
    """At most so many cases of each base, at random; each beginning of them is a fair sample.

    Every base as it is comes first.
    """
    taken: dict[str, int] = defaultdict(int)
    ranked = []
    order = stream(root_seed, "audit_real", "sample").permutation(len(cases)).tolist()
    for place in sorted(order, key=lambda place: cases[place].change != AS_IS):
        base = cases[place].base
        ranked.append((taken[base], place))
        taken[base] += 1
    ranked.sort(key=lambda item: item[0])
    return [cases[place] for rank, place in ranked if largest is None or rank < largest]


def measured(todo: Sequence[Case], file: Path, *, jobs: int) -> list[Result]:
    """Results of all cases; those that the file holds already are not measured again."""
    rows = json.loads(file.read_text()) if file.exists() else []
    known = {result.case: result for result in map(Result.from_row, rows)}
    missing = [case for case in todo if case not in known]
    for first in range(0, len(missing), jobs):
        block = missing[first : first + jobs]
        for result in map_shards(run, block, workers=jobs, scheduler=LOCAL):
            known[result.case] = result
            mark = "" if result.judged == RIGHT else f"  [right: {result.wanted}]"
            sure = "" if result.confidence is None else f" {result.confidence:.2f}"
            print(f"{result.judged:18s} {result.case.title}: {result.said}{sure}{mark}", flush=True)
        rows = [result.as_row() for result in known.values()]
        file.write_text(json.dumps(rows, indent=1) + "\n")
        print(so_far([known[case] for case in todo if case in known], len(todo)), flush=True)
    return [known[case] for case in todo]


def so_far(results: Sequence[Result], of: int) -> str:
    """What has been found up to here, a line: a run that is cut short has its figures."""
    count = Counter(result.judged for result in results)
    counted = ", ".join(f"{count[name]} {name}" for name in SHARES if count[name])
    return f"{len(results)} of {of}: {counted}"


def main() -> None:
    """Run the benchmark and write its tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.audit_real", description=__doc__)
    parser.add_argument("--half", choices=(DEVELOPMENT, REPORT), default=DEVELOPMENT)
    parser.add_argument("--only", default="", metavar="BASE/CHANGE", help="titles that hold it")
    parser.add_argument("--sample", type=int, help="recordings of each base, at most")
    parser.add_argument("--seed", type=int, help="other data of the development half")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--docs", type=Path, help="page between whose marks the tables go")
    parser.add_argument("--truth", type=Path, help="write what is true into this page, and end")
    parser.add_argument(
        "--list", action="store_true", help="print the cases with their truth, and end"
    )
    parser.add_argument("--out", type=Path, default=Path("build/audit-real"))
    options = parser.parse_args()
    first, what = options.seed or FIRST_DEVELOPMENT_SEED, "development half"
    if options.truth:
        into_page(options.truth, truth_tables(development(first)), TRUTH)
        return
    if options.half == REPORT:
        commit = frozen_commit(watched=(*DETECTOR, "benchmarks/audit_real"))
        first, what = report_seed(commit), f"report half, drawn from commit {commit}"
    cases = report(first) if options.half == REPORT else development(first)
    todo = [case for case in sampled(cases, first, options.sample) if options.only in case.title]
    if options.list:
        print("\n".join(case.title for case in todo))
        return
    begin = time.monotonic()
    options.out.mkdir(parents=True, exist_ok=True)
    text = markdown(measured(todo, options.out / "results.json", jobs=options.jobs), what=what)
    (options.out / "table.md").write_text(text)
    if options.docs:
        into_page(options.docs, text, RESULTS)
    print(text)
    print(f"{len(todo)} recordings in {time.monotonic() - begin:.0f} s, {options.jobs} at a time")


if __name__ == "__main__":
    main()
