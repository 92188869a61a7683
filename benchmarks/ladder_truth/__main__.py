"""`python -m benchmarks.ladder_truth`: plant each wrong in a copy of an honest ladder, run, count.

Results are one JSON file per plant; a run that was killed goes on where it was. The bases are
built once below `--work` (some minutes), the copies are removed after each run.
"""

import argparse
import dataclasses
import json
import os
import shutil
import sys
import time
import traceback
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from benchmarks.ladder_truth import tables, workspace
from benchmarks.ladder_truth.bringing import TWIN
from benchmarks.ladder_truth.catalogue import WRONGS
from benchmarks.ladder_truth.honest import HONEST, Variant
from benchmarks.ladder_truth.outcome import Seen, count, of_candidate, run
from benchmarks.ladder_truth.planting import Wrong


def arguments(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ladder_truth", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("build/ladder_truth/results"))
    parser.add_argument("--work", type=Path, default=Path("build/ladder_truth/work"))
    parser.add_argument("--only", action="append", default=[], help="name of a wrong or variant")
    parser.add_argument("--area", action="append", default=[], help="area, or `honest`")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--list", action="store_true", help="print the catalogue and stop")
    parser.add_argument("--docs", type=Path, help="page to print the table into")
    parser.add_argument("--table", action="store_true", help="print what was counted and stop")
    return parser.parse_args(argv)


def chosen(only: Sequence[str], areas: Sequence[str]) -> list[Wrong | Variant]:
    """Wrongs and variants that were asked for; all of them where nothing was.

    Raises:
        SystemExit: A name that is not in the catalogue.
    """
    items: list[Wrong | Variant] = [*WRONGS, *HONEST]
    unknown = set(only) - {item.name for item in items}
    unknown |= set(areas) - {area_of(item) for item in items}
    if unknown:
        sys.exit(f"not in the catalogue: {', '.join(sorted(unknown))}")
    if only:
        by_name = {item.name: item for item in items}
        return [by_name[name] for name in only]
    return [item for item in items if not areas or area_of(item) in areas]


def area_of(item: Wrong | Variant) -> str:
    """Area of a wrong; `honest` for a variant."""
    return item.area if isinstance(item, Wrong) else "honest"


def base_of(name: str, work: Path) -> Path:
    """The honest base of that name, built if it is not there."""
    target = work / name
    done = work / f"{name}.done"
    if done.exists():
        return target
    shutil.rmtree(target, ignore_errors=True)
    work.mkdir(parents=True, exist_ok=True)
    if name == "small":
        workspace.small(target)
    elif name == "brought":
        workspace.brought(target, base_of("small", work))
    else:
        workspace.signed(target)
    if not workspace.honest(target, name):
        raise RuntimeError(f"the honest base {name} is stopped: {workspace.look(target, name)}")
    done.touch()
    return target


def try_one(item: Wrong | Variant, base: Path, copy: Path) -> dict[str, object]:
    """Plant, run and count one wrong or variant; the copy is removed.

    Returns:
        What is written to its JSON file. `count` is `right`, `elsewhere` or `not at all` for a
        wrong, `let through` or `stopped` for a variant, `broken` where the machinery failed.
    """
    return try_together([item], base, copy)[0]


def try_together(
    items: Sequence[Wrong | Variant], base: Path, copy: Path
) -> list[dict[str, object]]:
    """The same of several that are planted into one copy and run once, each as one candidate."""
    began = time.monotonic()
    seen, note = Seen(()), ""
    try:
        shutil.copytree(base, copy, symlinks=True)
        for item in items:
            item.plant(copy)
        seen = run(copy, items[0].base)
    except Exception:
        note = traceback.format_exc()[-2000:]
    finally:
        shutil.rmtree(copy, ignore_errors=True)
    seconds = round(time.monotonic() - began, 1)
    return [_result(item, seen, note, seconds) for item in items]


def _result(item: Wrong | Variant, seen: Seen, note: str, seconds: float) -> dict[str, object]:
    if item.together:
        twin = "" if isinstance(item, Wrong) else TWIN
        seen = of_candidate(seen, item.candidate, twin=twin)
    if note:
        counted = "broken"
    elif isinstance(item, Wrong):
        counted = count(item.expected, seen)
    else:
        counted = "stopped" if seen.stops else "let through"
    return {
        "name": item.name,
        "area": area_of(item),
        "base": item.base,
        "expected": dataclasses.asdict(item.expected) if isinstance(item, Wrong) else None,
        "count": counted,
        "seen": dataclasses.asdict(seen),
        "seconds": seconds,
        "fault": note,
    }


def in_lots(items: Sequence[Wrong | Variant]) -> list[list[Wrong | Variant]]:
    """What runs in one copy: alone, or with all of those asked for that name the same lot."""
    lots: dict[str, list[Wrong | Variant]] = {}
    for item in items:
        lots.setdefault(item.together or item.name, []).append(item)
    return list(lots.values())


def _one(lot: Sequence[Wrong | Variant], work: Path, out: Path) -> list[dict[str, object]]:
    first = lot[0]
    copy = work / "copies" / f"{first.together or first.name}-{os.getpid()}"
    results = try_together(lot, work / first.base, copy)
    for result in results:
        path = out / f"{result['name']}.json"
        path.with_suffix(".tmp").write_text(json.dumps(result, indent=1, sort_keys=True) + "\n")
        path.with_suffix(".tmp").rename(path)
    return results


def main(argv: Sequence[str] | None = None) -> int:
    """Run what was asked for and has no result yet; print the table. 1 where a count is wrong."""
    args = arguments(argv)
    items = chosen(args.only, args.area)
    if args.list:
        print(tables.catalogue(items))
        return 0
    args.out.mkdir(parents=True, exist_ok=True)
    if not args.table:
        open_ones = [item for item in items if not (args.out / f"{item.name}.json").exists()]
        for base in dict.fromkeys(item.base for item in open_ones):
            base_of(base, args.work.resolve())
        places = (args.work.resolve(), args.out.resolve())
        with ThreadPoolExecutor(max_workers=args.jobs) as pool:
            futures = [pool.submit(_one, lot, *places) for lot in in_lots(open_ones)]
            for future in as_completed(futures):
                for result in future.result():
                    print(tables.line(result), flush=True)
    results = [
        json.loads(path.read_text())
        for item in items
        if (path := args.out / f"{item.name}.json").exists()
    ]
    text = tables.markdown(items, results)
    (args.out / "table.md").write_text(text)
    print(text)
    if args.docs:
        args.docs.write_text(tables.into_page(args.docs.read_text(), text))
    good = all(result["count"] in ("right", "let through") for result in results)
    return 0 if good and len(results) == len(items) else 1


if __name__ == "__main__":
    sys.exit(main())
