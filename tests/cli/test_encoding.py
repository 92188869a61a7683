"""A terminal that lacks a letter gets it escaped; a document that is printed stays itself."""

import io
import json

import pytest
import typer

from genpolicy.cli.encoding import escape_what_it_lacks
from genpolicy.cli.shell import run_program

SAID = {"text": "wide… ≤ 5 \N{GREEK SMALL LETTER TAU} \N{BLACK CHESS KNIGHT} \U0001f916 café"}


def terminal(encoding, errors="strict"):
    return io.TextIOWrapper(io.BytesIO(), encoding=encoding, errors=errors)


def printed(stream):
    stream.flush()
    return stream.buffer.getvalue().decode(stream.encoding)


@pytest.mark.parametrize("encoding", ["ascii", "iso8859-9", "cp1252", "utf-8"])
def test_a_document_is_the_same_in_every_encoding(encoding):
    stream = terminal(encoding)
    escape_what_it_lacks([stream])
    print(json.dumps(SAID, ensure_ascii=False), file=stream)
    assert json.loads(printed(stream)) == SAID
    assert ("wide…" in printed(stream)) == (encoding in ("utf-8", "cp1252"))


def test_who_chose_a_rule_keeps_it():
    stream = terminal("ascii", errors="replace")
    escape_what_it_lacks([stream, io.StringIO()])
    print("wide…", file=stream)
    assert printed(stream) == "wide?\n"


def test_a_command_says_all_of_it_and_ends_well(monkeypatch):
    def say() -> int:
        print(SAID["text"])
        return 0

    out = terminal("iso8859-9")
    monkeypatch.setattr("sys.stdout", out)
    app = typer.Typer()
    app.command()(say)
    assert run_program(app, "genpolicy say", []) == 0
    assert "wide\\u2026" in printed(out) and "café" in printed(out)
