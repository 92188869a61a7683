import subprocess
import sys

import pytest

from genpolicy.candidates.hosts import translation
from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.hosts.translation import as_server, program_files
from genpolicy.errors import ConfigError, ContractError
from genpolicy.integrity.hashing import sha256_file
from tests.candidates.conftest import ENTRY


def test_a_server_is_its_own(entry, task, tmp_path):
    assert as_server(entry, tmp_path / "candidate.yaml", task.observation) is entry


@pytest.mark.parametrize("kind", ["trained", "torch", "onnx", "scripted"])
def test_others_are_hosted_by_one_command_that_holds_the_entry_to_what_it_says(written, task, kind):
    path = written(kind)
    entry = read_entry(path)
    server = as_server(entry, path, task.observation)
    assert server.command[:2] == [sys.executable, "-P"]
    assert server.command[5:] == [
        "serve-candidate", str(path), "--port", "{port}", "--sha256", entry.sha256,
        "--width", f"observation={task.observation.dim}",
        *(["--observation", task.observation.hash()] if kind == "trained" else []),
    ]  # fmt: skip
    same = ("name", "author", "files", "horizons", "observation", "action", "timeout_s")
    assert all(getattr(server, name) == getattr(entry, name) for name in same)


def test_the_host_runs_the_code_that_asks_and_no_other_that_is_installed(
    written, task, tmp_path, monkeypatch
):
    """Wrong before: of two checkouts a candidate of the one was hosted by the code of the other."""
    said = tmp_path / "checkout" / "genpolicy" / "cli" / "main.py"
    said.parent.mkdir(parents=True)
    said.write_text("import sys\ndef main():\n    print(__file__, sys.argv[1:])\n    return 7\n")
    # A file of theirs that has a name of Python's own replaces nothing.
    (tmp_path / "checkout" / "random.py").write_text("raise SystemExit('theirs')\n")
    said.write_text("import random\n" + said.read_text())
    monkeypatch.setattr(translation, "ROOT", tmp_path / "checkout")
    path = written("torch")
    server = as_server(read_entry(path), path, task.observation)
    done = subprocess.run(server.command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (7, f"{said} {server.command[5:]}")


def test_a_channel_that_is_none_is_refused_before_anything_starts(written, task):
    path = written("torch", observation={"observation": {"channels": ["joints"]}})
    with pytest.raises(ContractError, match="'joints'"):
        as_server(read_entry(path), path, task.observation)


def test_lerobot_runs_in_its_own_interpreter(written, task, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = written("lerobot")
    with pytest.raises(ConfigError, match="make lerobot"):
        as_server(read_entry(path), path, task.observation)
    interpreter = tmp_path / "build" / "lerobot" / "bin" / "python"
    interpreter.parent.mkdir(parents=True)
    interpreter.symlink_to(sys.executable)
    server = as_server(read_entry(path), path, task.observation)
    assert server.command == [
        str(interpreter), str(translation.ADAPTER), "act", "--port", "{port}", "--device", "cpu",
    ]  # fmt: skip
    monkeypatch.setattr(translation, "ADAPTER", tmp_path / "absent.py")
    with pytest.raises(ConfigError, match=r"absent\.py"):
        as_server(read_entry(path), path, task.observation)


def test_what_runs_a_candidate_is_known_by_hash_beside_its_files(written, entry_of, tmp_path):
    assert program_files(read_entry(written("torch")), tmp_path) == {}
    lerobot = program_files(read_entry(written("lerobot")), tmp_path)
    assert lerobot == {"adapters/lerobot_server.py": sha256_file(translation.ADAPTER)}
    (tmp_path / "serve.py").write_text("first")
    (tmp_path / "weights.bin").write_text("weights")
    words = [sys.executable, "serve.py", "weights.bin", "absent.py", "--port", "{port}"]
    server = entry_of(address=None, command=words, files={"weights.bin": "0" * 64})
    first = program_files(server, tmp_path)
    assert list(first) == ["serve.py"]
    (tmp_path / "serve.py").write_text("second")
    assert program_files(server, tmp_path) != first
    assert program_files(entry_of(), tmp_path) == {}


def test_an_interpreter_of_the_folder_is_none_of_it_and_links_and_options_are(entry_of, tmp_path):
    """Wrong before: the link of an environment to its interpreter ended the stage for everybody."""
    (tmp_path / "venv/bin").mkdir(parents=True)
    (tmp_path / "venv/bin/python3.11").symlink_to(sys.executable)
    (tmp_path / "real.py").write_text("serve")
    (tmp_path / "serve.py").symlink_to(tmp_path / "real.py")
    (tmp_path / "config.yaml").write_text("steps: 2")
    words = ["venv/bin/python3.11", "serve.py", "--config=config.yaml", "--port={port}"]
    found = program_files(entry_of(address=None, command=words), tmp_path)
    assert found == {
        "serve.py": sha256_file(tmp_path / "real.py"),
        "config.yaml": sha256_file(tmp_path / "config.yaml"),
    }
    (tmp_path / "server").write_text("binary")
    own = program_files(entry_of(address=None, command=["server", "{port}"]), tmp_path)
    assert list(own) == ["server"]


def test_the_identity_of_an_entry_does_not_move_without_a_word(entry_of):
    """Evidence names it: another one makes all that was recorded another candidate's."""
    assert entry_of().sha256 == IDENTITY
    assert entry_of(name="another").sha256 != IDENTITY
    assert "address" in ENTRY


IDENTITY = "182f4f2b352cea8d5831d33bda549a712e098533586666be76f782aec22d3429"
