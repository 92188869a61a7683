"""What was said against what is true, and how often a verdict of some confidence is right."""

from collections import defaultdict
from collections.abc import Iterable, Sequence

from benchmarks.audit_real.catalogue import ORDER_AND_NAMES
from benchmarks.audit_real.runner import Result
from benchmarks.audit_real.truth import ALLOWED, RIGHT, UNDECIDED, WRONG
from genpolicy.statistics.intervals import clopper_pearson

BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99)
ROUND_UP = 1.0 + 1e-9
SHARES = (RIGHT, ALLOWED, UNDECIDED, WRONG)
VALID = "valid_modes"


def markdown(results: Sequence[Result], *, what: str) -> str:
    """All tables as Markdown."""
    parts = [
        f"{len(results)} recordings ({what}).", "", *_headline(results), "",
        "### Right by base", "", *_counts(results, lambda r: [r.base]), "",
        "### Right by change", "", *_counts(results, _changes), "",
        "### How often a verdict of some confidence is right", "", *reliability(results), "",
        *_wrong(results),
    ]  # fmt: skip
    return "\n".join(parts) + "\n"


def _headline(results: Sequence[Result]) -> list[str]:
    valid = [r for r in results if not r.wanted.startswith(VALID)]
    modes = [r for r in results if r.wanted.startswith(VALID)]
    good = [r for r in results if r.judged in (RIGHT, ALLOWED)]
    groups = _same(results)
    lines = [
        ("right, or undecided where the table allows it", len(good), len(results)),
        ("right", sum(r.judged == RIGHT for r in results), len(results)),
        ("undecided where one would decide", sum(r.judged == UNDECIDED for r in results),
         len(results)),
        ("wrong", sum(r.judged == WRONG for r in results), len(results)),
        ("valid_modes said of anything else", sum(r.verdict == VALID for r in valid), len(valid)),
        ("valid modes denied", sum(r.judged == WRONG for r in modes), len(modes)),
        ("another verdict in another order or under other names",
         sum(len(set(group)) > 1 for group in groups), len(groups)),
    ]  # fmt: skip
    rows = ["| | n | of | share | exact 95 % interval |", "|---|---|---|---|---|"]
    for name, k, n in lines:
        if n:
            low, high = clopper_pearson(k, n)
            rows.append(f"| {name} | {k} | {n} | {k / n:.3f} | {low:.3f} to {high:.3f} |")
    slow = sorted(r.wall_s for r in results)
    if slow:
        rows += ["", f"Import and audit took {slow[len(slow) // 2]:.1f} s in the middle, at most "
                 f"{slow[-1]:.1f} s (as loaded as the machine was)."]  # fmt: skip
    return rows


def _same(results: Iterable[Result]) -> list[list[str]]:
    """Verdicts of the same data in another order or under other names."""
    groups: dict[tuple[str, int], list[str]] = defaultdict(list)
    for r in results:
        if all(name in ORDER_AND_NAMES for name, _ in r.changes):
            groups[r.base, r.seed].append(r.verdict)
    return [group for group in groups.values() if len(group) > 1]


def _changes(result: Result) -> list[str]:
    names = [name for name, _ in result.changes]
    return names if len(names) == 1 else ["crossings of two"]


def _counts(results: Sequence[Result], keys) -> list[str]:
    counts: dict[str, dict[str, int]] = defaultdict(lambda: defaultdict(int))
    for result in results:
        for key in keys(result):
            counts[key][result.judged] += 1
    rows = [f"| | {' | '.join(SHARES)} |", "|---" * (len(SHARES) + 1) + "|"]
    for key, found in counts.items():
        rows.append(f"| {key} | {' | '.join(str(found.get(name, '')) for name in SHARES)} |")
    return rows


def reliability(results: Sequence[Result]) -> list[str]:
    """Share right by confidence, of the verdicts that decide something; and of all."""
    rows = [
        "| confidence | verdicts | right | share | exact 95 % interval | undecided, of them |",
        "|---|---|---|---|---|---|",
    ]
    for low, high in zip(BINS, (*BINS[1:], ROUND_UP), strict=True):
        part = [r for r in results if r.confidence is not None and low <= r.confidence < high]
        if part:
            right = sum(r.judged in (RIGHT, ALLOWED) for r in part)
            least, most = clopper_pearson(right, len(part))
            undecided = sum(r.judged in (ALLOWED, UNDECIDED) for r in part)
            top = min(high, 1.0)
            rows.append(
                f"| {low:.2f} to {top:.2f} | {len(part)} | {right} | {right / len(part):.2f} "
                f"| {least:.2f} to {most:.2f} | {undecided} |"
            )
    return rows


def _wrong(results: Sequence[Result]) -> list[str]:
    wrong = [r for r in results if r.judged in (WRONG, UNDECIDED)]
    if not wrong:
        return []
    rows = [
        "### Wrong answers, and open ones where one would decide", "",
        "| recording | seed | said | confidence | right |", "|---|---|---|---|---|",
    ]  # fmt: skip
    for r in wrong:
        sure = "" if r.confidence is None else f"{r.confidence:.2f}"
        rows.append(f"| {r.case.title} | {r.seed} | {r.said} | {sure} | {r.wanted} |")
    return rows
