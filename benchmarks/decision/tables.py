"""What was counted, as text."""

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.decision.catalogue import GRADED, NULLS, POWERS
from benchmarks.decision.rule import COUNTS
from benchmarks.decision.worlds import World
from genpolicy.statistics.intervals import clopper_pearson

BEGIN, END = "<!-- begin of {} -->", "<!-- end of {} -->"
CONFIDENCE = 0.95


def into_page(page: str, name: str, table: str) -> str:
    """The page with this table between the marks of that name.

    Raises:
        ValueError: The marks are not there once, in this order.
    """
    begin, end = BEGIN.format(name), END.format(name)
    before, found, rest = page.partition(begin)
    _, ended, after = rest.partition(end)
    if not (found and ended):
        raise ValueError(f"the page has no {begin} ... {end}")
    return f"{before}{begin}\n\n{table}\n{end}{after}"


def kept(world: World, hits: int, trials: int) -> bool | None:
    """Whether the share keeps what was fixed, at the worse end; None where nothing was."""
    low, high = clopper_pearson(hits, trials, CONFIDENCE)
    if world.most is not None:
        return high <= world.most
    return low >= world.least if world.least is not None else None


def promotion(results: Mapping[str, Mapping[str, Any]]) -> str:
    """Tables of the promotion rule alone."""
    return _tables(
        results,
        [
            ("False promotion: at most 5 %", NULLS),
            ("Power, and who is chosen of several", POWERS),
        ],
    )


def graded(results: Mapping[str, Mapping[str, Any]]) -> str:
    """The same where outcomes are graded."""
    return _tables(results, [("Graded outcomes: false promotion at most 5 %, and power", GRADED)])


def _tables(
    results: Mapping[str, Mapping[str, Any]], parts: Sequence[tuple[str, Sequence[World]]]
) -> str:
    lines: list[str] = []
    for title, worlds in parts:
        lines += [f"**{title}**", "", "| world | counted | trials | share | 95 % interval | kept |"]
        lines.append("|---|---|---|---|---|---|")
        lines += [
            _row(world, asks, results[world.name])
            for world in worlds
            if world.name in results
            for asks in world.asks
        ]
        lines.append("")
    return "\n".join(lines)


def _row(world: World, asks: str, result: Mapping[str, Any]) -> str:
    hits, trials = result["hits"][asks], result["trials"]
    low, high = clopper_pearson(hits, trials, CONFIDENCE)
    judged = kept(world, hits, trials) if asks == world.asks[0] else None
    mark = {True: "yes", False: "**no**", None: "not asked"}[judged]
    return (
        f"| {world.name}: {world.what} | {COUNTS[asks]} | {trials:,} | {hits / trials:.4f} "
        f"| {low:.4f} to {high:.4f} | {mark} |"
    )


def whole(results: Sequence[Mapping[str, Any]]) -> str:
    """Table of the whole gate: verdicts of the first candidate, and what decided."""
    lines = ["| world | trials | PASS | INCONCLUSIVE | FAIL | what was not met, of 100 trials |"]
    lines.append("|---|---|---|---|---|---|")
    for result in results:
        trials = result["trials"]
        shares = [_share(result["verdicts"].get(v, 0), trials) for v in VERDICTS]
        unmet = sorted(result["unmet"].items(), key=lambda item: -item[1])[:4]
        told = ", ".join(f"{name} {100 * count / trials:.0f}" for name, count in unmet)
        what = f"{result['name']}: {result['what']}"
        lines.append(f"| {what} | {trials} | {' | '.join(shares)} | {told or 'nothing'} |")
    return "\n".join(lines) + "\n"


VERDICTS = ("PASS", "INCONCLUSIVE", "FAIL")


def _share(count: int, trials: int) -> str:
    low, high = clopper_pearson(count, trials, CONFIDENCE)
    return f"{count / trials:.3f} ({low:.3f} to {high:.3f})"
