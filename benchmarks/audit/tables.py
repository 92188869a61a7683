"""The benchmark's tables: confusion, accuracy by cause and strength, and the two costly errors."""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from benchmarks.audit.cases import CAUSES
from benchmarks.audit.runner import Result
from genpolicy.statistics.intervals import clopper_pearson

VALID, OPEN = "valid_modes", "insufficient_support"
BEGIN, END = "<!-- tables of the benchmark -->", "<!-- end of the tables -->"


def markdown(results: Sequence[Result], *, seeds: str) -> str:
    """All tables as Markdown."""
    strong = [result for result in results if result.strong]
    parts = [
        f"{len(results)} data sets ({seeds}), {len(strong)} of them at or above the stated "
        "minimum strength.",
        "",
        *_headline(strong, results),
        "",
        "### What was planted (rows, from the minimum strength on) and what was said (columns)",
        "",
        *_confusion(strong),
        "",
        "### Right answers by cause and strength",
        "",
        "Named: the planted cause was said. Open: too little to decide was said, which stops a "
        "ladder and is no answer. Need: valid modes were said. From the minimum on only the "
        "planted cause is right. Below it nothing is right or wrong: what was said stands here, "
        "and the audit must not be relied on to name the cause.",
        "",
        *_strengths(results),
        "",
        *_wrong(results),
        "",
        "### Why the minimum lies where it lies",
        "",
        *_minima(),
    ]
    return "\n".join(parts) + "\n"


def into_page(page: Path, text: str) -> None:
    """Put the tables between the marks of a page."""
    before, rest = page.read_text().split(BEGIN)
    page.write_text(f"{before}{BEGIN}\n\n{text}\n{END}{rest.split(END)[1]}")


def _minima() -> list[str]:
    rows = ["| cause | named from | because |", "|---|---|---|"]
    for cause in CAUSES:
        bound = "at most " if cause.falling else ""
        single = len(cause.strengths) == 1
        least = cause.unit if single else f"{bound}{cause.minimum:g} {cause.unit}"
        rows.append(f"| {cause.name} | {least} | {cause.reason} |")
    return rows


def _headline(strong: Sequence[Result], results: Sequence[Result]) -> list[str]:
    others = [r for r in strong if r.group != VALID]
    weak = [r for r in results if not r.strong and r.group != VALID]
    valid = [r for r in strong if r.group == VALID]
    lines = [
        ("right, from the minimum strength on", sum(r.right for r in strong), len(strong)),
        ("left open, from the minimum strength on", sum(_open(r) for r in strong), len(strong)),
        (
            "false need: valid_modes said of anything else",
            sum(r.verdict == VALID for r in others), len(others),
        ),
        (
            "below the minimum: valid_modes said although a cause was planted",
            sum(r.verdict == VALID for r in weak), len(weak),
        ),
        ("below the minimum: planted cause not said", sum(not r.named for r in weak), len(weak)),
        (
            "true modes denied: another cause said",
            sum(r.verdict != VALID and not _open(r) for r in valid), len(valid),
        ),
        ("true modes left open", sum(_open(r) for r in valid), len(valid)),
    ]  # fmt: skip
    for task in ("planar", "insertion"):
        part = [r for r in strong if r.job.task == task]
        lines.append((f"right, {task}", sum(r.right for r in part), len(part)))
    rows = ["| | n | of | share | exact 95 % interval |", "|---|---|---|---|---|"]
    for name, k, n in lines:
        if n:
            low, high = clopper_pearson(k, n)
            rows.append(f"| {name} | {k} | {n} | {k / n:.3f} | {low:.4f} to {high:.4f} |")
    return rows


def _open(result: Result) -> bool:
    """Whether too little to decide was said, where something could have been decided."""
    return result.verdict == OPEN and result.group != OPEN


def _said(result: Result) -> str:
    if result.verdict == "unimodal" and result.kind == "one_valid_mode":
        return "one valid mode"
    return result.verdict


def _confusion(results: Sequence[Result]) -> list[str]:
    counts: dict[str, dict[str, int]] = defaultdict(lambda: defaultdict(int))
    for result in results:
        counts[result.group][_said(result)] += 1
    columns = sorted({name for row in counts.values() for name in row})
    rows = [f"| planted | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    for group, said in counts.items():
        cells = [str(said.get(name, "")) for name in columns]
        rows.append(f"| {group} | {' | '.join(cells)} |")
    return rows


def _strengths(results: Sequence[Result]) -> list[str]:
    rows = [
        "| cause | strength | minimum | named | open | need | of |",
        "|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for cause in CAUSES:
        for strength in cause.strengths:
            part = [r for r in results if r.name == cause.name and r.job.strength == strength]
            if part:
                mark = "yes" if cause.strong(strength) else "below"
                named, left = sum(r.named for r in part), sum(_open(r) for r in part)
                need = sum(r.verdict == VALID for r in part)
                rows.append(
                    f"| {cause.name} | {strength:g} {cause.unit} | {mark} | {named} | {left} "
                    f"| {need} | {len(part)} |"
                )
    return rows


def _wrong(results: Sequence[Result]) -> list[str]:
    wrong = [r for r in results if r.strong and not r.right]
    if not wrong:
        return []
    rows = [
        "### Wrong and open answers, from the minimum strength on", "",
        "| cause | strength | task | seed | said |", "|---|---|---|---|---|",
    ]  # fmt: skip
    for r in wrong:
        said = f"{r.verdict}({', '.join(x for x in (r.variable, r.kind) if x)})"
        rows.append(f"| {r.name} | {r.job.strength:g} | {r.job.task} | {r.job.seed} | {said} |")
    return rows
