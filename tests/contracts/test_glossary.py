"""One set of words: the glossary is short, and what it bans names nothing."""

import ast
import re
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GLOSSARY = ROOT / "gates" / "pages" / "glossary.md"
PRODUCT = ("genpolicy", "gates", "stages", "flows")
MOST_LINES = 40
# Words of the design that the glossary must explain.
WORDS = ("action step", "sampler step", "NFE", "invocation", "candidate", "proposal", "event time",
         "action age", "mode", "calibration epoch", "evidence", "criterion", "verdict", "situation",
         "layer", "topic", "fixture", "session", "phase", "cause", "promotion",
         "mutant")  # fmt: skip


def listed(start: str) -> list[str]:
    """Names in backticks on the line of the glossary that begins with `start`."""
    line = next(row for row in GLOSSARY.read_text().splitlines() if row.startswith(start))
    return re.findall(r"`(\w+)`", line)


def parts(name: str) -> list[str]:
    """The words of an identifier, `broken_seam` or `EntrantTable`, in small letters."""
    return [part.lower() for part in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]


def given_names(source: str) -> set[str]:
    """Every name that a module gives: definitions, parameters, variables, attributes, keywords."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                found.add(node.name)
            case ast.arg() | ast.keyword():
                found |= {node.arg or ""}
            case ast.Name(ctx=ast.Store()):
                found.add(node.id)
            case ast.Attribute(ctx=ast.Store()):
                found.add(node.attr)
            case ast.alias():
                found |= {node.asname or ""}
    return found


@cache
def defined() -> dict[str, str]:
    """Name by `module:name` of everything that the product gives a name to, private or local."""
    return {
        f"{path.relative_to(ROOT).with_suffix('').as_posix().replace('/', '.')}:{name}": name
        for folder in PRODUCT
        for path in sorted((ROOT / folder).rglob("*.py"))
        for name in given_names(path.read_text())
    }


def banned_names() -> set[str]:
    banned = {word.strip("_").lower() for word in listed("Not used as names")}
    return {place for place, name in defined().items() if banned & set(parts(name))}


def classes_of_one_name() -> dict[str, int]:
    """How many classes have each name that may stand for one thing only, where several do."""
    counts = dict.fromkeys(listed("One class each"), 0)
    for folder in PRODUCT:
        for path in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.ClassDef) and node.name in counts:
                    counts[node.name] += 1
    return {name: count for name, count in counts.items() if count > 1}


def test_the_glossary_is_short_and_explains_the_words() -> None:
    text = GLOSSARY.read_text()
    assert len(text.splitlines()) <= MOST_LINES
    terms = [row.split("|")[1] for row in text.splitlines() if row.startswith("| ")]
    for word in WORDS:
        assert any(re.search(rf"\b{word}\b", term) for term in terms), word


def test_no_word_is_explained_twice() -> None:
    rows = [row for row in GLOSSARY.read_text().splitlines() if row.startswith("| ")]
    terms = [term.strip() for row in rows for term in row.split("|")[1].split(",")]
    assert len(terms) == len(set(terms))


def test_banned_words_name_nothing() -> None:
    assert sorted(banned_names()) == []


def test_parameters_variables_and_private_names_are_read() -> None:
    source = (
        "import seam_a as seam_b\nclass _SeamC: ...\ndef f(seam_d, *, g=1):\n"
        "    seam_e, self.seam_f = 1, 2\n    return h(seam_g=1), lambda seam_h: seam_h\n"
    )
    found = {name for name in given_names(source) if "seam" in parts(name)}
    assert found == {"_SeamC", *(f"seam_{letter}" for letter in "bdefgh")}


def test_a_word_names_one_class() -> None:
    assert classes_of_one_name() == {}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("broken_seam", ["broken", "seam"]),
        ("EntrantTable", ["entrant", "table"]),
        ("HTTPCase2", ["http", "case", "2"]),
        ("understanding", ["understanding"]),
    ],
)
def test_identifiers_are_read_word_by_word(name: str, words: list[str]) -> None:
    assert parts(name) == words


if __name__ == "__main__":
    sys.stdout.write("\n".join([*sorted(banned_names()), str(classes_of_one_name()), ""]))
