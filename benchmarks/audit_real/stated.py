"""The truth of every case in words, written down before any of them is run."""

from collections.abc import Sequence
from pathlib import Path

from benchmarks.audit_real.catalogue import AS_IS, BASES, CHANGES, Case, made

TRUTH = ("<!-- truth, before any run -->", "<!-- end of the truth -->")
# The truth does not depend on how many episodes there are.
FEW = 24
RESULTS = ("<!-- tables of the report -->", "<!-- end of the report -->")


def truth_tables(cases: Sequence[Case]) -> str:
    """What is right of each base as it is, what each change does, and the cases of development."""
    rows = [
        "### Bases",
        "",
        "| base | layout | as it is | right | because |",
        "|---|---|---|---|---|",
    ]
    for name, make in BASES.items():
        recording = made(Case(name, ((AS_IS, 1.0),), 1), episodes=FEW)
        truth = recording.truth
        text = (make.__doc__ or "").strip().splitlines()[0]
        reason = truth.undecided or "repeated or shared places: one can look"
        rows.append(f"| {name} | {recording.layout} | {text} | {truth.as_text()} | {reason} |")
    rows += ["", "### Changes", "", "| change | strengths | what is true then |", "|---|---|---|"]
    for change in CHANGES.values():
        strengths = ", ".join(f"{s:.4g}" for s in change.strengths) if change.unit else ""
        rows.append(f"| {change.name} | {f'{strengths} {change.unit}'.strip()} | {change.truth} |")
    rows += [
        "",
        "### Cases of the development half",
        "",
        "| recording | seed | right |",
        "|---|---|---|",
    ]
    rows += [f"| {c.title} | {c.seed} | {made(c, episodes=FEW).truth.as_text()} |" for c in cases]
    return "\n".join(rows) + "\n"


def into_page(page: Path, text: str, marks: tuple[str, str]) -> None:
    """Put a text between two marks of a page."""
    begin, end = marks
    before, rest = page.read_text().split(begin)
    page.write_text(f"{before}{begin}\n\n{text}\n{end}{rest.split(end)[1]}")
