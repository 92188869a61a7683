"""Words of a server's command: what is known by hash, by version, or refused."""

import sys

import pytest

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.hosts.commands import (
    installed_module,
    module_files,
    require_known_words,
)
from genpolicy.candidates.hosts.forms import require_forms
from genpolicy.candidates.hosts.translation import as_server, program_files
from genpolicy.errors import ConfigError
from genpolicy.evidence.documents.brought import brought_document
from genpolicy.integrity.hashing import sha256_bytes, sha256_file

FILES = {"weights.bin": "0" * 64}
RECORD = """policies/__init__.py,sha256=one,3
policies/serve.py,sha256={digest},7
policies/__pycache__/serve.cpython-311.pyc,,
policies-1.2.dist-info/RECORD,,
../../../bin/policies,sha256=of-this-machine,9
"""


@pytest.fixture
def place(tmp_path):
    """The folder of an entry, with a module, a package, and an environment beside it."""
    own = tmp_path / "own"
    for name in ("serve.py", "pack/__init__.py", "pack/deep/__main__.py", "pack/one.py",
                 "weights.bin"):  # fmt: skip
        (own / name).parent.mkdir(parents=True, exist_ok=True)
        (own / name).write_text(name)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere/serve.py").write_text("")
    (tmp_path / "env/bin").mkdir(parents=True)
    (tmp_path / "env/bin/python").symlink_to(sys.executable)
    return own


def install(place, digest="two", version="1.2"):
    """A distribution in that environment; gives its interpreter."""
    info = place.parent / "env/lib/python3.12/site-packages" / "policies-1.2.dist-info"
    info.mkdir(parents=True, exist_ok=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: policies\nVersion: {version}\n")
    (info / "RECORD").write_text(RECORD.format(digest=digest))
    return str(place.parent / "env/bin/python")


@pytest.fixture
def server_of(entry_of):
    """A server with a command of such words, that pins such files."""
    return lambda *words, files=FILES: entry_of(
        address=None, command=[*words, "--port", "{port}"], files=files
    )


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["-m", "serve"], ["serve.py"]),
        (["-mserve"], ["serve.py"]),
        (["-u", "-W", "ignore", "-Bm", "serve", "-m", "pack"], ["serve.py"]),
        (["-m", "pack.one"], ["pack/__init__.py", "pack/one.py"]),
        (["-m", "pack.deep"], ["pack/__init__.py", "pack/deep/__main__.py"]),
        (["-m", "absent"], []),
        (["serve.py", "-m", "pack.one"], []),
        (["-c", "pass", "-m", "pack.one"], []),
        (["-u"], []),
    ],
)
def test_files_of_a_module_of_the_folder_are_known_by_hash(server_of, place, words, found):
    """Wrong before: another module behind the same name was the same candidate."""
    entry = server_of("python", *words)
    assert module_files(entry, place) == found
    hashed = program_files(entry, place)
    assert {name: hashed[name] for name in found} == {
        name: sha256_file(place / name) for name in found
    }


def test_of_another_program_a_word_is_no_module(server_of, place):
    assert module_files(server_of("docker", "-m", "serve"), place) == []


def test_an_installed_module_is_known_by_version_and_by_what_was_installed(server_of, place):
    """Bytecode, and scripts with a path of this machine in them, are no part of it."""
    entry = server_of(install(place), "-m", "policies.serve")
    said = b"policies/__init__.py sha256=one\npolicies/serve.py sha256=two"
    first = installed_module(entry, place)
    assert first == {"policies==1.2": sha256_bytes(said)}
    install(place, digest="three")
    assert installed_module(entry, place).keys() == first.keys()
    assert installed_module(entry, place) != first
    install(place, version="1.3")
    assert list(installed_module(entry, place)) == ["policies==1.3"]
    assert installed_module(server_of(install(place), "-m", "serve"), place) == {}
    assert installed_module(server_of(install(place), "-m", "polic"), place) == {}


def test_an_editable_install_is_known_by_its_version(server_of, place):
    found = installed_module(server_of(sys.executable, "-m", "genpolicy"), place)
    assert [name.partition("==")[0] for name in found] == ["genpolicy"]


def test_the_ladder_writes_both(server_of, place, tmp_path):
    def written(*words):
        entry = server_of(*words)
        brought = BroughtPolicy("planted", place / "entry.yaml", entry, entry.sha256, 0)
        return brought_document([brought])["planted"].program

    assert written("python", "-m", "serve") == {"serve.py": sha256_file(place / "serve.py")}
    assert list(written(install(place), "-m", "policies")) == ["policies==1.2"]


@pytest.mark.parametrize(
    "words",
    [
        [sys.executable, "serve.py"],
        ["../env/bin/python", "-m", "serve"],
        ["python", "-m", "genpolicy"],
        ["python", "-m", "http.server"],
        ["python", "-u", "-c", "pass"],
        ["/usr/bin/env"],
        ["genpolicy", "--weights=weights.bin", "--prefix", "/api", "--log", "/dev/null"],
        ["./serve.py", "../absent"],
    ],
)
def test_what_a_command_may_name(server_of, place, words):
    require_known_words(server_of(*words), place)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["python", "{out}/serve.py"], "'{out}/serve.py', which lies outside"),
        (["python", "serve.py", "--weights={out}"], "'{out}', which lies outside"),
        (["python", "../elsewhere/serve.py"], r"'\.\./elsewhere/serve.py', which lies outside"),
        (
            ["python", "../own/serve.py"],
            r"'\.\./own/serve.py', which lies outside .* or is named so",
        ),
        (["sh", "-c", "pass", "../elsewhere"], r"'\.\./elsewhere'"),
        (["{out}/serve.py"], "'{out}/serve.py', which lies outside"),
        (["python", "-m", "no_such_module"], "'-m no_such_module', a module that is neither"),
        (["no_such/bin/python3", "-m", "policies"], "'-m policies', a module"),
    ],
)
def test_what_nothing_of_the_entry_pins_is_refused(server_of, place, words, told, task):
    out = str(place.parent / "elsewhere")
    words, told = [word.replace("{out}", out) for word in words], told.replace("{out}", out)
    entry = server_of(*words)
    for ask in (
        lambda: require_known_words(entry, place),
        lambda: require_forms(entry, place),
        lambda: as_server(entry, place / "entry.yaml", task.observation),
    ):
        with pytest.raises(ConfigError, match=f"command of .* is {told}.*no hash") as error:
            ask()
        assert error.value.exit_code == 2
    require_known_words(server_of(*words, files={}), place)
