"""Seconds of each test file, from what pytest wrote of a run: which file is slow?

`python -m pytest tests/gates --junit-xml=build/gates.xml`, then
`python -m benchmarks.seconds build/gates.xml`. Wall time with fixtures, the slowest file first;
what several processes did at once adds up to more than the run took.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

HEADS = ("file", "tests", "s", "s a test", "slowest test", "s")


@dataclass(frozen=True)
class FileSeconds:
    """One test file.

    Attributes:
        name: Path below the repository, dots between folders, as pytest names it.
        tests: Tests that were run.
        seconds: All of them with their fixtures, s.
        slowest: Name of the slowest.
        slowest_s: What it took, s.
    """

    name: str
    tests: int
    seconds: float
    slowest: str
    slowest_s: float


def files_of(report: Path) -> list[FileSeconds]:
    """Test files of a run, the slowest first.

    Args:
        report: What pytest wrote with `--junit-xml`.
    """
    found: dict[str, list[tuple[float, str]]] = {}
    for case in ElementTree.parse(report).iter("testcase"):
        taken = (float(case.attrib["time"]), case.attrib["name"])
        found.setdefault(case.attrib["classname"], []).append(taken)
    files = [
        FileSeconds(name, len(taken), sum(s for s, _ in taken), max(taken)[1], max(taken)[0])
        for name, taken in found.items()
    ]
    return sorted(files, key=lambda file: (-file.seconds, file.name))


def table(files: list[FileSeconds]) -> Iterator[str]:
    """Lines of a table in Markdown."""
    yield f"| {' | '.join(HEADS)} |"
    yield f"|{'---|' * len(HEADS)}"
    for file in files:
        each = file.seconds / file.tests
        yield (
            f"| {file.name} | {file.tests} | {file.seconds:.1f} | {each:.2f} | {file.slowest} | "
            f"{file.slowest_s:.1f} |"
        )
    tests, seconds = sum(f.tests for f in files), sum(f.seconds for f in files)
    yield f"| {len(files)} files | {tests} | {seconds:.1f} | | | |"


def main() -> None:
    """Print the table of a report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("report", type=Path, help="what pytest wrote with --junit-xml")
    print("\n".join(table(files_of(parser.parse_args().report))))


if __name__ == "__main__":
    main()
