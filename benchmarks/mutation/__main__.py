"""Would the tests of the gates notice? Wrong gates, made by a tool, and the share that turns red.

The mutants are those of Cosmic Ray (`pip install -e '.[mutation]'`). They are run here and not by
its own command, because half of the time of a mutant would go into imports: libraries are imported
once, and each mutant is a forked process in which one module of `gates` is compiled from changed
text. No file on disk is changed, so a run that is cut leaves nothing behind. `plan.KINDS` says
which operators are kept; `|` is not, since it stands in annotations mostly. See docs/mutation.md.

    python -m benchmarks.mutation run gates/card --sample 60 --near --out build/mutation.jsonl
    python -m benchmarks.mutation again --out build/mutation.jsonl     # its survivors, once more
    python -m benchmarks.mutation show --out build/mutation.jsonl
    python -m benchmarks.mutation named                                # those written by hand
"""

import argparse
import json
import os
import sys
import time
from dataclasses import asdict
from pathlib import Path

from benchmarks.mutation.named import run_named
from benchmarks.mutation.plan import ROOT, Mutant, drawn, inside, modules, mutants_of, tests_of
from benchmarks.mutation.runner import KILLED, SURVIVED, run


def rows_of(out: Path) -> list[dict]:
    """Last row of each mutant in a file of results; none where there is no file yet."""
    lines = out.read_text().splitlines() if out.is_file() else []
    return list({key(row): row for row in map(json.loads, lines)}.values())


def key(row: dict) -> tuple[str, str, int]:
    """What a mutant is known by, as long as its module stays as it is."""
    return row["path"], row["kind"], row["occurrence"]


def show(out: Path) -> None:
    """Print the table of kills by folder, with exact intervals, and what no test noticed.

    Killed is what turned a test red; of these, the nearest noticed by themselves, being asked
    first. What was stopped for its time, or by a fault of the process, was noticed by nobody: it
    stands apart, and lowers the share.
    """
    from genpolicy.statistics.intervals import clopper_pearson

    groups: dict[str, list[dict]] = {}
    for row in rows_of(out):
        folder = "/".join(row["path"].split("/")[:2])
        groups.setdefault(folder if not folder.endswith(".py") else "gates/*.py", []).append(row)
    whole = [row for rows in groups.values() for row in rows]
    print("| where | mutants | killed | by the nearest | stopped | survived | share killed "
          "| 95 % interval |")  # fmt: skip
    print("|---" * 8 + "|")
    for name, rows in (*sorted(groups.items()), ("all", whole)):
        killed = sum(said(row) == KILLED for row in rows)
        survived = sum(said(row) == SURVIVED for row in rows)
        low, high = clopper_pearson(killed, len(rows))
        share = f"{killed / len(rows):.3f} | {low:.3f} to {high:.3f}"
        stopped = len(rows) - killed - survived
        near = sum(said(row) == KILLED and by_nearest(row) for row in rows)
        print(f"| `{name}` | {len(rows)} | {killed} | {near} | {stopped} | {survived} | {share} |")
    print()
    for row in whole:
        if said(row) != KILLED:
            change = " -> ".join(line[1:].strip() for line in row["change"].splitlines())
            place = f"`{row['path']}`, {row['inside']}"
            print(f"- {said(row)}: {place}: `{change}` ({row['kind'][5:]})")


def said(row: dict) -> str:
    """The outcome; `killed (time)` was written once of what was stopped."""
    return row["outcome"].replace("killed (", "stopped (")


def by_nearest(row: dict) -> bool:
    """Whether the test that turned red is of the file that is asked first."""
    return f" {tests_of(row['path'])[0]}::" in row["red"]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("what", choices=["run", "again", "count", "show", "named"])
    parser.add_argument("places", nargs="*", default=[])
    parser.add_argument("--sample", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--near", action="store_true")
    parser.add_argument("--green", action="store_true")
    parser.add_argument("--out", type=Path, default=ROOT / "build/mutation.jsonl")
    asked = parser.parse_args()
    os.chdir(ROOT)
    sys.path.insert(0, str(ROOT))
    os.environ.update(OMP_NUM_THREADS="1", PYTHONHASHSEED="0", MPLBACKEND="Agg")
    places = asked.places or ["gates"]
    started = time.monotonic()
    if asked.what == "count":
        for path in modules(places):
            print(len(mutants_of(path)), path)
    elif asked.what == "run":
        done = {key(row) for row in rows_of(asked.out)}
        chosen = [m for m in drawn(places, asked.sample, asked.seed) if key(asdict(m)) not in done]
        run(chosen, asked.out, asked.jobs, near=asked.near, green=asked.green)
        print(f"{time.monotonic() - started:.0f} s")
    elif asked.what == "named":
        sys.exit(run_named(asked.places, green=asked.green) > 0)
    elif asked.what == "again":
        left = [row for row in rows_of(asked.out) if row["outcome"] == SURVIVED]
        fields = Mutant.__dataclass_fields__
        again = [Mutant(**{name: row[name] for name in fields}) for row in left]
        chosen = [mutant for mutant in again if inside(mutant.path, places)]
        run(chosen, asked.out, asked.jobs, near=asked.near, green=asked.green)
    else:
        show(asked.out)


if __name__ == "__main__":
    main()
