"""The first page holds each text that its parts found, in the order in which a reader weighs it."""

import dataclasses
import html
import itertools
import re
import shlex

import typer.main

from gates.card.commands import card
from gates.pages import page
from gates.writing import write_gate

KEPT = {"gate", "also", "verdict", "criteria", "candidate", "signed", "about"}
"""Fields that the page looks something up by: gates, verdicts, candidates, places of criteria."""
SECTIONS = [
    "What could make this wrong", "How close to each limit", "Watch it", "What it costs",
    "Evidence, gate by gate", "What you sign", "Your part", "The gates",
    "Commands, hashes, settings, words",
]  # fmt: skip
PARTS = ("desk_of", "signing_of", "costs_of", "end_of")


def marked(value, count, name="", path=""):
    """A part with a mark of its own behind each text in it."""
    if isinstance(value, str):
        known = name in KEPT or not value
        return value if known else f"{value}§{path}.{name} {next(count)}§"
    if isinstance(value, tuple):
        return tuple(marked(item, count, name, path) for item in value)
    if dataclasses.is_dataclass(value):
        own = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
        who = type(value).__name__
        return dataclasses.replace(
            value, **{key: marked(item, count, key, who) for key, item in own.items()}
        )
    return value


def marks_in(value):
    if isinstance(value, str):
        return set(re.findall("§[^§]+§", value))
    if isinstance(value, tuple):
        return set().union(*map(marks_in, value))
    if dataclasses.is_dataclass(value):
        fields = (getattr(value, f.name) for f in dataclasses.fields(value))
        return set().union(*map(marks_in, fields))
    return set()


def shown(root, monkeypatch):
    """The page, and the marks that its parts were given."""
    count, made = itertools.count(), []
    for name in PARTS:
        part = getattr(page, name)

        def with_marks(*given, part=part):
            made.append(marked(part(*given), count))
            return made[-1]

        monkeypatch.setattr(page, name, with_marks)
    text = html.unescape(page.index_page(root))
    assert len(made) == len(PARTS)
    return text, set().union(*map(marks_in, made))


def test_every_text_of_a_ladder_that_waits_for_people_is_on_its_page(copied, monkeypatch):
    write_gate(copied, "E")
    text, marks = shown(copied, monkeypatch)
    kinds = {mark.strip("§").split(" ")[0] for mark in marks}
    assert {"Asked.title", "Asked.text", "Asked.pending", "Doubt.kind", "Doubt.text"} <= kinds
    assert {"Box.number", "Bar.measured", "Bar.limit", "Duty.remark", "Item.seen"} <= kinds
    assert {"Cell.value", "Cell.of", "Method.name", "End.hashes", "Signing.lacking"} <= kinds
    lost = [mark for mark in marks if mark not in text]
    assert [mark.strip("§").split(" ")[0] for mark in lost] == ["Method.kind"], (
        "of the promoted one alone, where `promoted` stands in its place"
    )


def test_every_text_of_a_folder_where_nothing_was_judged_is_on_its_page(tmp_path, monkeypatch):
    text, marks = shown(tmp_path, monkeypatch)
    kinds = {mark.strip("§").split(" ")[0] for mark in marks}
    assert {"Asked.title", "Costs.missing", "Signing.missing"} <= kinds
    assert not {mark for mark in marks if mark not in text}


def test_doubts_come_before_what_holds_and_parts_in_the_order_of_their_numbers(copied):
    write_gate(copied, "E")
    text = page.index_page(copied)
    heads = [html.unescape(head) for head in re.findall(r"<h2[^>]*>(.*?)</h2>", text)]
    assert heads == [f"{n} · {said}" for n, said in enumerate(SECTIONS, 1)]
    places = [text.index(sign) for sign in (
        '<div class="asked">', '<div class="boxes">', '<ol class="doubts">', 'class="bars"',
        'class="costs"', 'class="signing"', 'class="duties"', 'class="ladder"',
    )]  # fmt: skip
    assert places == sorted(places)


def test_what_a_signer_is_told_to_type_is_typed_so(copied):
    """Words of the page that no test of the command line reads: each a command with its options."""
    write_gate(copied, "E")
    text = page.index_page(copied)
    lines = [line for block in re.findall(r"<pre>(.*?)</pre>", text, re.DOTALL)
             for line in html.unescape(block).splitlines()]  # fmt: skip
    typed = [shlex.split(line, comments=True) for line in lines]
    known = typer.main.get_command(card).commands
    assert [words[2] for words in typed] == ["keygen", "fill", "sign", "verify"]
    for program, group, name, *options in typed:
        assert (program, group) == ("genpolicy", "card")
        own = {flag for param in known[name].params for flag in param.opts}
        needed = {param.opts[0] for param in known[name].params if param.required}
        flags = {word for word in options if word.startswith("--")}
        assert flags <= own and needed <= flags, (name, flags, needed)
