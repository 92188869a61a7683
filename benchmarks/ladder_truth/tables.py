"""What was counted, as text."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.ladder_truth.honest import Variant
from benchmarks.ladder_truth.planting import Wrong

COUNTS = ("right", "elsewhere", "not at all", "broken")
Result = Mapping[str, Any]
WIDTH = 130
BEGIN, END = "<!-- begin of table -->", "<!-- end of table -->"


def into_page(page: str, table: str) -> str:
    """The page with this table between its marks.

    Raises:
        ValueError: The marks are not there once, in this order.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"the page has no {BEGIN} ... {END}")
    return f"{before}{BEGIN}\n\n{table}\n{END}{after}"


def catalogue(items: Sequence[Wrong | Variant]) -> str:
    """The catalogue: what is planted, and what has to stop it."""
    lines = []
    for item in items:
        if isinstance(item, Wrong):
            lines.append(f"{item.area:<11} {item.name:<36} {_expected(item):<60} {item.wrong}")
        else:
            lines.append(f"{'honest':<11} {item.name:<36} {'not stopped':<60} {item.what}")
    return "\n".join(lines)


def line(result: Result) -> str:
    """One plant, when it is done."""
    return f"{result['count']:<11} {result['name']:<36} {result['seconds']:>6} s  {_first(result)}"


def markdown(items: Sequence[Wrong | Variant], results: Sequence[Result]) -> str:
    """Counts by area, then every wrong and variant with what stopped it."""
    by_name = {result["name"]: result for result in results}
    wrongs = [item for item in items if isinstance(item, Wrong)]
    variants = [item for item in items if isinstance(item, Variant)]
    lines = ["| area | planted | run | right | elsewhere | not at all | broken |"]
    lines.append("|---|---|---|---|---|---|---|")
    for area in dict.fromkeys(item.area for item in wrongs):
        lines.append(_row(area, [item for item in wrongs if item.area == area], by_name))
    lines.append(_row("all", wrongs, by_name))
    done = [by_name[item.name] for item in variants if item.name in by_name]
    through = sum(result["count"] == "let through" for result in done)
    lines += ["", f"Honest variants: {len(variants)}, run {len(done)}, let through {through}.", ""]
    lines += ["| wrong | what is wrong | has to stop it | count | what was seen |"]
    lines += ["|---|---|---|---|---|"]
    for item in wrongs:
        result = by_name.get(item.name)
        counted = f"**{result['count']}**" if result else "not run"
        note = f" {item.note}" if item.note else ""
        lines.append(
            f"| {item.name} | {item.wrong}{note} | {_expected(item)} | {counted} "
            f"| {_cell(_first(result))} |"
        )
    lines += [
        "",
        "| honest variant | what was changed | count | what was seen |",
        "|---|---|---|---|",
    ]
    for variant in variants:
        result = by_name.get(variant.name)
        counted = f"**{result['count']}**" if result else "not run"
        lines.append(f"| {variant.name} | {variant.what} | {counted} | {_cell(_first(result))} |")
    return "\n".join(lines) + "\n"


def _row(area: str, wrongs: Sequence[Wrong], by_name: Mapping[str, Result]) -> str:
    done = [by_name[item.name]["count"] for item in wrongs if item.name in by_name]
    counts = Counter(done)
    cells = [str(counts[name]) for name in COUNTS]
    return f"| {area} | {len(wrongs)} | {len(done)} | {' | '.join(cells)} |"


def _expected(item: Wrong) -> str:
    reasons = list(item.expected.criteria)
    if item.expected.refusal:
        reasons.append("refusal")
    return f"{item.expected.gate}: {', '.join(reasons)}"


def _first(result: Result | None) -> str:
    if result is None:
        return ""
    if result["fault"]:
        return str(result["fault"]).strip().splitlines()[-1]
    stops = result["seen"]["stops"]
    if not stops:
        return "no stop"
    reasons = dict.fromkeys(f"{stop['gate']}: {stop['reason']}" for stop in stops)
    named = ", ".join(list(reasons)[:4])
    return f"{named} ({stops[0]['detail'][:WIDTH]})"


def _cell(text: str) -> str:
    return " ".join(text.replace("|", "\\|").split())
