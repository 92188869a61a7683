"""One program: its help fits a terminal, names every command and loads nothing heavy."""

import os
import re
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from typer.core import TyperGroup

sys.path.insert(0, str(Path(__file__).parent))

from metadata import ROOT, project, write_metadata

from gates.pages.desk_end import COMMANDS
from genpolicy.cli.main import main
from genpolicy.cli.shell import GROUP, loaded

COLUMNS = 80
NAMED = r"(?:^|[`(&] ?|@|-m )genpolicy ([a-z][a-z -]*)"
OWN = {
    *("propose", "ingest", "fixtures", "replay", "doctor"),
    *("serve-policy", "serve-candidate", "check-candidate", "export"),
}
# Not pydantic: the library of the command line reads options with it.
HEAVY = {
    *("torch", "mujoco", "pandas", "numpy", "scipy", "sklearn", "matplotlib", "pyarrow"),
    *("prefect", "dvc", "dask", "pinocchio", "fcl", "cryptography", "jinja2", "httpx", "rich"),
}


@pytest.fixture(scope="session")
def metadata(tmp_path_factory):
    return write_metadata(tmp_path_factory.mktemp("metadata"))


@pytest.fixture(autouse=True)
def tree(metadata, monkeypatch):
    monkeypatch.syspath_prepend(str(metadata))
    monkeypatch.setenv("COLUMNS", str(COLUMNS))


def registered() -> set[str]:
    return set(project()["entry-points"][GROUP])


def help_of(words: list[str], capsys) -> str:
    assert main([*words, "--help"]) == 0
    return capsys.readouterr().out


def every_command() -> list[tuple[str, ...]]:
    """The words of every command and of every group, the program itself included."""
    found: list[tuple[str, ...]] = []

    def walk(command, words) -> None:
        if command.hidden:  # a retired name, which says what to type
            return
        found.append(words)
        if isinstance(command, TyperGroup):
            for name in command.list_commands(None):
                walk(command.get_command(None, name), (*words, name))

    for name in sorted(registered()):
        walk(loaded(EntryPoint(name, project()["entry-points"][GROUP][name], GROUP)), (name,))
    return [(), *((name,) for name in sorted(OWN)), *found]


@pytest.mark.parametrize("words", every_command(), ids=" ".join)
def test_the_help_of_every_command_fits_80_columns_and_shows_an_example(words, capsys) -> None:
    text = help_of(list(words), capsys)
    wide = [line for line in text.splitlines() if len(line) > COLUMNS]
    assert wide == []
    if "Commands:" in text:
        assert "..." not in text.partition("Commands:")[2], "a first sentence is too long"
    else:
        assert f"genpolicy {words[0]}" in text.partition("Examples:")[2]


def test_the_commands_that_the_desk_names_exist() -> None:
    known = every_command()
    for command, _ in COMMANDS:
        program, *words = command.split()
        of_a_group = any(len(name) > 1 and name[0] == words[0] for name in known)
        assert program == "genpolicy"
        assert tuple(words[: 2 if of_a_group else 1]) in known, command


def test_the_program_lists_every_command_and_no_name_twice(capsys) -> None:
    listed = re.findall(r"^  (\S+)  ", help_of([], capsys).partition("Commands:")[2], re.MULTILINE)
    assert set(listed) == OWN | {words[0] for words in every_command() if words}
    assert len(listed) == len(set(listed))


def test_a_command_that_prints_a_table_also_prints_json(capsys) -> None:
    for words in (["gates", "check"], ["gates", "summary"], ["gates", "show"], ["gates", "verify"],
                  ["verify", "report"], ["card", "verify"], ["doctor"], ["ingest"]):  # fmt: skip
        assert "--json" in help_of(words, capsys), words


@pytest.mark.parametrize("words", [[], ["ingest"], ["audit"], ["gates", "verify"], ["ladder"]])
def test_help_loads_nothing_heavy(metadata, words) -> None:
    code = (
        "import sys\n"
        "from genpolicy.cli.main import main\n"
        f"assert main({[*words, '--help']!r}) == 0\n"
        f"print('heavy', sorted({HEAVY!r} & set(sys.modules)))\n"
    )
    path = os.pathsep.join([str(metadata), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "heavy []"


@pytest.mark.parametrize(
    ("module", "same"),
    [("genpolicy", []), ("gates", ["gates"]), ("flows.reproduce", ["reproduce"]),
     ("flows.ladder", ["ladder"]), ("flows.workspace", ["workspace"]), ("flows.serve", ["serve"]),
     ("flows.resume", ["resume"])],
)  # fmt: skip
def test_a_module_is_the_same_command_under_another_name(metadata, module, same, capsys) -> None:
    path = os.pathsep.join([str(metadata), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-m", module, "--help"],
        env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    expected, found = help_of(same, capsys).split("\n", 1), done.stdout.split("\n", 1)
    assert found[1] == expected[1]


def test_the_documents_name_only_commands_that_there_are() -> None:
    known = {" ".join(words) for words in every_command()}
    groups = {"gates", "verify"}
    for path in (ROOT / "README.md", ROOT / "Makefile", *(ROOT / "docs").glob("*.md")):
        for line in re.findall(
            r"(?:^|[`(&] ?|@|-m )genpolicy ([a-z][a-z -]*)", path.read_text(), re.M
        ):
            words = line.split()
            name = " ".join(words[:2]) if words[0] in groups and len(words) > 1 else words[0]
            assert name in known, f"{path.name}: genpolicy {line}"
