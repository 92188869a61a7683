"""Programs and checkpoints are loaded in a child, and held against their entry, before all."""

import pickle
import socket

import pytest

from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.hosts.loadable import require_answering, require_loadable
from genpolicy.errors import ConfigError
from genpolicy.integrity.hashing import sha256_file
from tests.candidates.conftest import ENTRY
from tests.candidates.hosts.conftest import NOISE

PATIENT = {"start_timeout_s": 300.0}
IN_MM = {**ENTRY["action"], "position": {"columns": [0, 1, 2], "unit": "mm"}}
OBSERVED = ENTRY["observation"]["observation"]


def require(path, task):
    require_loadable(read_entry(path), path, task.observation)


def with_bytes(write, kind, name, data):
    """An entry that pins other bytes of one of its files."""
    path = write(kind, **PATIENT)
    (path.parent / name).write_bytes(data)
    files = {each: sha256_file(path.parent / each) for each in read_entry(path).files}
    text = path.read_text()
    for each, digest in read_entry(path).files.items():
        text = text.replace(digest, files[each])
    path.write_text(text)
    return path


@pytest.mark.parametrize("kind", ["torch", "onnx"])
def test_a_program_of_its_entry_s_ports_is_loaded(written, task, kind):
    require(written(kind, **PATIENT), task)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"noise": {**NOISE, "shape": [8, 10]}}, r"\(8, 10\)"),
        ({"observation": {"state": OBSERVED}}, "state"),
    ],
)
def test_other_shapes_or_names_than_the_entry_s(written, task, changes, told):
    with pytest.raises(ConfigError, match=rf"torch\.yaml.*refused by its host.*{told}"):
        require(written("torch", **changes, **PATIENT), task)


def test_a_pickle_is_no_program_and_is_not_opened(written, task, tmp_path):
    class Opened:
        def __reduce__(self):
            return open, (str(tmp_path / "opened"), "w")

    path = with_bytes(written, "torch", "policy.pt2", pickle.dumps(Opened()))
    with pytest.raises(ConfigError, match=r"refused by its host.*no archive"):
        require(path, task)
    assert not (tmp_path / "opened").exists()


def test_no_checkpoint(written, task):
    path = with_bytes(written, "trained", "flow/model.safetensors", b"x")
    with pytest.raises(ConfigError, match=r"refused by its host.*config.json"):
        require(path, task)


def test_one_that_takes_too_long_is_told_so(written, task):
    with pytest.raises(ConfigError, match=r"0.01 s, in which it was not loaded"):
        require(written("torch", start_timeout_s=0.01), task)


@pytest.mark.parametrize("kind", ["scripted", "lerobot"])
def test_what_would_run_is_not_started(written, task, kind, monkeypatch):
    monkeypatch.setattr("subprocess.run", lambda *_, **__: pytest.fail("it was started"))
    require(written(kind), task)


def test_a_checkpoint_of_another_card_is_refused_by_its_host(checkpoint, task):
    """Wrong before: the first stage took it, and the ladder trained."""
    require(checkpoint(**PATIENT), task)
    with pytest.raises(ConfigError, match=r"trained\.yaml.*refused by its host.*unit 'mm'.*'m'"):
        require(checkpoint(action=IN_MM, **PATIENT), task)


def test_a_server_that_runs_already_is_called(serving, entry_of, tmp_path):
    """Wrong before: an address at which nobody answers was found behind all trainings."""
    path = tmp_path / "planted.yaml"
    with serving(lambda message: pytest.fail("it was asked"), {}) as address:
        require_answering(entry_of(address=address), path)
    for where in (address, "ws://127.0.0.1:1"):
        with pytest.raises(ConfigError, match=rf"planted\.yaml: address is {where}.*Start it"):
            require_answering(entry_of(address=where), path)
    require_answering(entry_of(address=None, command=["never", "{port}"]), path)


def test_one_that_hangs_is_not_waited_for_longer_than_an_answer(entry_of, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"ws://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(ConfigError, match="where no policy answers"):
            require_answering(entry_of(address=address, timeout_s=0.2), tmp_path / "planted.yaml")
