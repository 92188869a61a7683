"""The README's map names what there is, and all of it; its numbers are those of the reports."""

import copy
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

sys.path.insert(0, str(Path(__file__).parent))

import readme
import terminal

from flows.estimate import DOCUMENTED
from gates.overview import COLOURS

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


PHOTOGRAPHED = ("pictures/prefect.png",)
"""Pages of programs that are not ours: no number of ours stands on them that could go stale."""


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


def test_what_the_readme_says_of_the_default_ladder_is_what_the_reports_say() -> None:
    text, found = README.read_text(), readme.reports()
    assert found, "no report lies in reports/"
    assert readme.whole(text, found) == text, (
        "run `python tests/contracts/readme.py --write`, and read the words around it"
    )


@pytest.mark.parametrize("name", ["measured", "threshold", "interval", "verdict"])
def test_a_number_that_moves_is_seen(name: str) -> None:
    """Injected fault: one field of the criterion that decides."""
    found = readme.reports()
    moved = copy.deepcopy(found)
    item = next(i for i in moved["A"]["criteria"] if i["id"] == "remedy_valid_share")
    item[name] = {"interval": [0.1, 0.2], "verdict": "FAIL"}.get(name, 0.123)
    assert readme.section(moved) != readme.section(found)


def test_the_readme_says_how_long_a_run_takes_and_what_a_terminal_shows_after_it() -> None:
    found = readme.reports()
    said = readme.run(found)
    takes, _, shot = said.partition("\n\n")
    assert takes in f"{DOCUMENTED}." and re.search(r"`make smoke` \d+ to \d+ min", takes)
    assert shot == f"![{readme.title(found)}](docs/pictures/terminal.svg)\n"
    moved = copy.deepcopy(found)
    moved["A"]["verdict"] = "FAIL"
    assert readme.run(moved) != said


def test_the_picture_of_a_terminal_is_that_of_the_reports() -> None:
    found = readme.reports()
    assert (ROOT / readme.PICTURE).read_text() == readme.picture(found), (
        "run `python tests/contracts/readme.py --write`"
    )
    moved = copy.deepcopy(found)
    item = next(i for i in moved["A"]["criteria"] if i["id"] == "remedy_valid_share")
    item["interval"] = [0.123, item["interval"][1]]
    assert readme.picture(moved) != readme.picture(found)


def test_the_picture_of_a_terminal_shows_its_lines_as_text_and_in_its_colours() -> None:
    found = readme.reports()
    lines = readme.shown(found)
    drawing = ElementTree.fromstring(readme.picture(found))
    rows = drawing.findall("{*}text")
    assert ["".join(row.itertext()).rstrip() for row in rows] == lines
    assert max(map(len, lines)) <= 80
    states = [re.match(r"gate_([a-e]) +([A-Z_ ]+?) *$", line) for line in lines]
    assert [(state[1].upper(), state[2]) for state in states if state] == [
        (gate, found[gate]["verdict"] if gate in found else "NOT JUDGED") for gate in "ABCDE"
    ]
    inks = {"".join(span.itertext()).strip(): span.get("class") for span in drawing.iter()
            if span.tag.endswith("tspan")}  # fmt: skip
    verdict = found["A"]["verdict"]
    assert COLOURS[verdict] == inks[verdict]


def test_a_line_wider_than_a_terminal_is_not_drawn() -> None:
    terminal.drawn([f"\x1b[31m{'x' * 80}\x1b[0m"], title="fits")
    with pytest.raises(ValueError, match="81 columns, expected at most 80"):
        terminal.drawn(["x" * 81], title="does not")


@pytest.mark.parametrize("scheme", [terminal.LIGHT, terminal.DARK])
def test_every_colour_of_the_picture_can_be_read(scheme: dict[str, str]) -> None:
    """WCAG: 4.5 to 1 for text of this size."""

    def luminance(colour: str) -> float:
        parts = (int(colour[n : n + 2], 16) / 255 for n in (1, 3, 5))
        linear = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
        return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))

    ground = luminance(scheme["ground"])
    for name in scheme.keys() - {"ground"}:
        low, high = sorted((luminance(scheme[name]), ground))
        assert (high + 0.05) / (low + 0.05) >= 4.5, name


def test_a_row_is_as_a_person_reads_it() -> None:
    """Golden by hand."""
    item = {
        "id": "x_share", "candidate": "flow", "question": "Enough?", "measured": 0.51234,
        "interval": [0.36, 0.51234], "counted": "223 episodes", "comparison": "<=",
        "threshold": 0.5, "verdict": "INCONCLUSIVE",
    }  # fmt: skip
    report = {"verdict": "FAIL", "decision": "No.", "diagnosis": "a. Next: b.",
              "criteria": [item, {**item, "id": "held", "verdict": "PASS"}]}  # fmt: skip
    assert readme.section({"B": report}).splitlines()[:2] + readme.section(
        {"B": report}
    ).splitlines()[5:] == [
        "**Gate B is FAIL**: 1 of 2 criteria hold.",
        "No. Next: b.",
        "| `x_share` of flow | Enough? | 51.2 % (36 % to 51.2 %), 223 episodes | ≤ 50 % | open |",
    ]


def test_the_picture_of_the_flow_has_every_stage_and_no_other() -> None:
    chart = README.read_text().partition("```mermaid\n")[2].partition("```")[0]
    stages = set(yaml.safe_load((ROOT / "dvc.yaml").read_text())["stages"])
    words = re.sub(r"-- \w+ -->|-->|\(\[.*?\]\)|flowchart", " ", chart)
    named = set(re.findall(r"[a-z][a-z_]+", words))
    gates = set(re.findall(r"\{(\w+)\}", chart))
    assert stages <= named | gates
    assert (named | gates) - stages <= {"people"}


def test_every_picture_of_a_document_is_there_and_draws_itself() -> None:
    for path in (README, *(ROOT / "docs").glob("*.md")):
        for name in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", path.read_text()):
            picture = path.parent / name
            assert picture.is_file(), f"{path.name}: {name}"
            if name in PHOTOGRAPHED:
                assert picture.stat().st_size < 150_000
                continue
            assert picture.suffix == ".svg", "a picture that nobody makes again goes stale"
