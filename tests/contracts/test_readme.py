"""The README's map names what there is, and all of it."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
TOP = ("benchmarks", "flows", "gates", "genpolicy", "stages", "tests")


def rows(text: str) -> list[tuple[str, str]]:
    """Folder and what it holds, of each row of the map."""
    section = text.partition("## Where things live")[2].partition("\n## ")[0]
    found = [line.strip("|").split("|") for line in section.splitlines() if line.startswith("| `")]
    return [(row[0], row[1]) for row in found]


def paths(row: tuple[str, str]) -> list[Path]:
    """Every path that a row names: its folders, and what it says to lie in the first of them.

    Of several folders only the first is written from the root; the others stand beside it.
    """
    folders = re.findall(r"`([\w/.-]+)`", row[0])
    first = Path(folders[0])
    beside = [first.parent / name for name in folders[1:]]
    inside = [name for name in re.findall(r"`([\w/.-]+)`", row[1]) if "/" in name or "." in name]
    placed = [Path(name) if name.split("/")[0] in TOP else first / name for name in inside]
    return [first, *beside, *placed]


def missing(text: str) -> list[str]:
    """Paths of the map that do not exist."""
    return [
        path.as_posix() for row in rows(text) for path in paths(row) if not (ROOT / path).exists()
    ]


def test_every_path_of_the_map_exists() -> None:
    assert len(rows(README.read_text())) >= 10
    assert missing(README.read_text()) == []


def test_every_package_stands_on_the_map() -> None:
    named = {path for row in rows(README.read_text()) for path in paths(row)}
    packages = {
        path.parent.relative_to(ROOT) for path in (ROOT / "genpolicy").glob("*/__init__.py")
    }
    top = {Path(name) for name in TOP} - {Path("genpolicy")}
    assert sorted(map(str, (packages | top) - named)) == []


def test_a_path_that_is_gone_is_found() -> None:
    text = (
        "## Where things live\n\n| `gates/` | `need/` (A), `reproducibility.py` (B), a `word` |\n"
        "| `genpolicy/data`, `gone` | `tests/none` |\n\n## More\n`other.py`\n"
    )
    assert missing(text) == ["gates/reproducibility.py", "genpolicy/gone", "tests/none"]
