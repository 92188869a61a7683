"""What the documents for newcomers say is what the program does: commands, outputs, sentences."""

import re
import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "data"))

import factory
from metadata import ROOT, write_metadata

from genpolicy.cli.main import main

DOCS = ROOT / "docs"
NEWCOMERS = ("index.md", "example.md", "refusals.md", "troubleshooting.md", "candidates.md")
LEFT_OUT = "..."


@pytest.fixture(scope="module")
def metadata(tmp_path_factory):
    return write_metadata(tmp_path_factory.mktemp("metadata"))


@pytest.fixture(autouse=True)
def tree(metadata, monkeypatch):
    monkeypatch.syspath_prepend(str(metadata))
    monkeypatch.setenv("COLUMNS", "80")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where it is run: seven recordings, one cut off; settings and reports; no evidence."""
    place = tmp_path_factory.mktemp("example")
    (place / "recordings").mkdir()
    paths = factory.write_all(place / "recordings", [factory.episode(n) for n in range(7)])
    paths[3].write_bytes(paths[3].read_bytes()[:-30])
    for path in ROOT.glob("*.yaml"):
        shutil.copy(path, place)
    shutil.copytree(ROOT / "reports", place / "reports")
    return place


def steps(text):
    """(command, lines that it is said to print) of the console blocks, in order."""
    found = []
    for block in re.findall(r"```console\n(.*?)```", text, re.DOTALL):
        for line in block.splitlines():
            if line.startswith("$ "):
                found.append((line[2:], []))
            else:
                found[-1][1].append(line)
    return found


def agrees(said, printed):
    """Whether lines are those that were printed, but for what is left out.

    Within a line three dots stand for any words, on a line of their own for any lines.
    """
    if not said:
        return not printed
    if said[0] == LEFT_OUT:
        return any(agrees(said[1:], printed[place:]) for place in range(len(printed) + 1))
    like = re.escape(said[0]).replace(re.escape(LEFT_OUT), ".*")
    return bool(printed) and bool(re.fullmatch(like, printed[0])) and agrees(said[1:], printed[1:])


def test_the_example_prints_what_it_says(folder, monkeypatch, capsys) -> None:
    monkeypatch.chdir(folder)
    told, code = steps((DOCS / "example.md").read_text()), 0
    assert len(told) >= 8
    for command, said in told:
        if command == "echo $?":
            assert said == [str(code)]
            continue
        code = main(command.split()[1:])
        printed = capsys.readouterr()
        lines = (printed.out + printed.err).splitlines()
        assert agrees(said, lines), f"{command}\n" + "\n".join(lines)


@pytest.mark.parametrize(
    ("said", "printed", "same"),
    [
        (["a", "b"], ["a", "b"], True),
        (["a"], ["a", "b"], False),
        (["a", "..."], ["a", "b", "c"], True),
        (["a", "...", "d"], ["a", "b", "c", "d"], True),
        (["a", "...", "d"], ["a", "b", "c"], False),
        (["a ... (x)"], ["a 7 (x)"], True),
        (["a ..."], ["b 7"], False),
        (["a ...", "c"], ["a 7", "b", "c"], False),
    ],
)
def test_only_what_is_left_out_may_differ(said, printed, same) -> None:
    assert agrees(said, printed) == same


def sentences(text):
    """Sentence and file of each row of the tables that name a file last."""
    found = []
    for line in text.splitlines():
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip().strip("|"))]
        named = re.fullmatch(r"`([\w/.]+)`", cells[-1])
        if len(cells) >= 2 and named and (ROOT / named[1]).is_file():
            found.append((cells[0], named[1]))
    return found


def said_in(path):
    """A source with texts that go on in the next line joined, and all space alike."""
    joined = re.sub(r"\"\s*\n\s*f?\"", "", (ROOT / path).read_text())
    return " ".join(joined.split())


def absent(sentence, path):
    """Parts of a sentence that its file does not say."""
    parts = re.split(r"…|, expected |(?<=\w)\. |^\.|\.$", sentence)
    source = said_in(path)
    return [part for part in (one.strip(" .,;:()") for one in parts) if part not in source]


TOLD = [
    pytest.param(*row, id=f"{name} {row[0][:40]}")
    for name in ("refusals.md", "troubleshooting.md")
    for row in sentences((DOCS / name).read_text())
]


@pytest.mark.parametrize(("sentence", "path"), TOLD)
def test_a_sentence_is_one_that_its_file_says(sentence, path) -> None:
    assert absent(sentence, path) == []


def test_sentences_are_found_and_a_wrong_one_is_seen() -> None:
    assert len(TOLD) >= 20
    assert absent("… never edit a novel.", "gates/proof.py") == ["never edit a novel"]


def commands(text):
    """Words of each command that a document gives, in blocks and between accents."""
    lines = re.findall(r"^\$? ?genpolicy (.+)$", text, re.MULTILINE)
    lines += re.findall(r"`genpolicy ([^`]+)`", text)
    words = [re.split(r"\s#|;", line)[0].split() for line in lines]
    return [one for one in words if one[0][0].islower() and not one[0].endswith(":")]


def command_of(words, capsys):
    """The help of the command that some words begin with."""
    place, helped = [], ""
    for word in words:
        if word.startswith("-") or (place and "Commands:" not in helped):
            break
        assert main([*place, word, "--help"]) == 0, f"genpolicy {' '.join(words)}"
        helped = capsys.readouterr().out
        place.append(word)
    return helped


@pytest.mark.parametrize("path", ["../README.md", *NEWCOMERS])
def test_every_command_and_every_option_of_it_is_one_that_there_is(path, capsys) -> None:
    found = commands((DOCS / path).read_text())
    assert found or path == "index.md"
    for words in found:
        helped = command_of(words, capsys)
        for word in words:
            if word.startswith("--") and word != "--help":
                assert re.search(rf"{word}\b", helped), f"genpolicy {' '.join(words)}"


def test_an_option_that_there_is_not_is_seen(capsys) -> None:
    helped = command_of(["export", "rollout", "flow/push/0", "--to", "gif"], capsys)
    assert "--to" in helped and "--format" not in helped
    with pytest.raises(AssertionError):
        command_of(["export", "film"], capsys)


def test_the_index_names_every_document_and_no_other() -> None:
    linked = set(re.findall(r"\]\(([\w-]+\.md)", (DOCS / "index.md").read_text()))
    assert linked == {path.name for path in DOCS.glob("*.md")} - {"index.md"}


@pytest.mark.parametrize("name", ["README.md", *(f"docs/{name}" for name in NEWCOMERS)])
def test_what_is_linked_is_there(name) -> None:
    path = ROOT / name
    for target in re.findall(r"\]\(([^)#:]+)\)", path.read_text()):
        assert (path.parent / target).exists(), target


def test_a_decision_stands_under_its_number_once():
    """Others name it by that number; a merge once kept an older wording beside the newer one."""
    text = (DOCS / "decisions.md").read_text()
    numbers = re.findall(r"^\*\*(\d+)\.", text, re.MULTILINE)
    assert len(numbers) > 300
    assert sorted({n for n in numbers if numbers.count(n) > 1}) == []
