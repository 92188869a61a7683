"""A hash of one training, and a command that serves another one."""

import pytest

from genpolicy.candidates.hosts.forms import require_forms
from genpolicy.candidates.hosts.served_weights import require_served_weights
from genpolicy.candidates.hosts.translation import as_server
from genpolicy.errors import ConfigError

FIRST, SECOND = "flow/seed_0/model.safetensors", "flow/seed_1/model.safetensors"


@pytest.fixture
def place(tmp_path):
    for name in (FIRST, SECOND, "logs/run.json"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_bytes(b"")
    return tmp_path


@pytest.fixture
def server_of(entry_of):
    """A server with a command of such words, that pins such files."""

    def made(*words, files=(FIRST,)):
        command = ["genpolicy", "serve-policy", *words, "--port", "{port}"]
        return entry_of(address=None, command=command, files=dict.fromkeys(files, "0" * 64))

    return made


@pytest.mark.parametrize("word", ["flow/seed_0", "./flow/seed_0/", "--weights=flow/seed_0", "logs",
                                  ".", "../elsewhere", "/dev/shm", "absent"])  # fmt: skip
def test_a_folder_of_pinned_weights_or_of_none_is_served(server_of, place, word):
    require_served_weights(server_of(word), place)


@pytest.mark.parametrize("word", ["flow/seed_1", "./flow/seed_1/", "--weights=flow/seed_1"])
def test_weights_of_another_training_than_the_pinned_are_refused(server_of, place, word, task):
    """Wrong before: they were judged under the hash of the first."""
    entry = server_of(word)
    for ask in (
        lambda: require_forms(entry, place),
        lambda: as_server(entry, place / "candidate.yaml", task.observation),
    ):
        with pytest.raises(ConfigError, match=rf"files .* is without {SECOND}, .*<sha256>"):
            ask()
    require_served_weights(server_of(word, files=(FIRST, SECOND)), place)


@pytest.mark.parametrize("ending", [".safetensors", ".onnx", ".pt2", ".pt", ".pth", ".ckpt"])
def test_weights_are_known_by_their_endings(server_of, place, ending):
    (place / f"logs/model{ending}").write_bytes(b"")
    with pytest.raises(ConfigError, match=rf"logs/model\{ending}"):
        require_served_weights(server_of("logs"), place)


def test_who_pins_nothing_is_left_to_gate_b(server_of, place):
    require_served_weights(server_of("flow/seed_1", files=()), place)
