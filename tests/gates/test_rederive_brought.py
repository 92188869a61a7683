"""Who was brought is read again: from the entry and the files as they are now."""

import pytest
import yaml

from gates.rederive_brought import brought_policy, rederive_brought
from genpolicy.candidates.brought import read_brought
from genpolicy.errors import ConfigError, IntegrityError, RefusedError
from genpolicy.evidence.documents.brought import BROUGHT, brought_document
from genpolicy.integrity.hashing import sha256_file
from tests.candidates.conftest import ENTRY

PARAMS = {
    "candidates": {"planted": "own/planted.yaml"},
    "horizons": ENTRY["horizons"],
    "policy": {"seeds": [3]},
}


@pytest.fixture
def workspace(tmp_path):
    """A workspace to which a policy was brought, and what its stage wrote."""
    own = tmp_path / "own"
    own.mkdir()
    (own / "weights.bin").write_bytes(b"weights")
    entry = {**ENTRY, "files": {"weights.bin": sha256_file(own / "weights.bin")}}
    (own / "planted.yaml").write_text(yaml.safe_dump(entry))
    folder = tmp_path / "artifacts/candidates"
    folder.mkdir(parents=True)
    found = read_brought(PARAMS["candidates"], seed=3, root=tmp_path)
    BROUGHT.write(folder, brought_document(found))
    return tmp_path


def test_what_the_stage_wrote_is_what_the_entry_says(workspace):
    rederive_brought(workspace, PARAMS)
    assert brought_policy(workspace, PARAMS, "planted").seed == 3
    assert brought_policy(workspace, PARAMS, "flow") is None


def test_an_entry_that_says_something_else_now_is_refused(workspace):
    path = workspace / "own/planted.yaml"
    path.write_text(yaml.safe_dump({**yaml.safe_load(path.read_text()), "timeout_s": 1.0}))
    with pytest.raises(RefusedError, match=r"candidates\.json: planted"):
        rederive_brought(workspace, PARAMS)


def test_another_author_in_the_evidence_is_refused(workspace):
    """The author may not review it: who forges this line could."""
    folder = workspace / "artifacts/candidates"
    path = folder / BROUGHT.file
    path.write_text(path.read_text().replace("author@example.org", "other@example.org"))
    with pytest.raises(RefusedError, match=r"candidates\.json: planted"):
        rederive_brought(workspace, PARAMS)


def test_another_file_is_refused(workspace):
    (workspace / "own/weights.bin").write_bytes(b"weightz")
    with pytest.raises(IntegrityError, match="planted"):
        rederive_brought(workspace, PARAMS)


def test_another_program_behind_the_same_files_is_refused(workspace):
    """Its entry, weights and answers to hashes are the same; what serves them is not."""
    own, path = workspace / "own", workspace / "own/planted.yaml"
    command = ["python", "serve.py", "--port", "{port}"]
    served = {**yaml.safe_load(path.read_text()), "address": None, "command": command}
    path.write_text(yaml.safe_dump(served))
    (own / "serve.py").write_text("first")
    found = read_brought(PARAMS["candidates"], seed=3, root=workspace)
    BROUGHT.write(workspace / "artifacts/candidates", brought_document(found))
    rederive_brought(workspace, PARAMS)
    (own / "serve.py").write_text("second")
    with pytest.raises(RefusedError, match=r"candidates\.json: planted"):
        rederive_brought(workspace, PARAMS)


def test_one_that_params_do_not_name_is_refused(workspace):
    with pytest.raises(RefusedError, match=r"candidates\.json: planted"):
        rederive_brought(workspace, {**PARAMS, "candidates": {}})


def test_a_workspace_without_the_section_is_a_bad_setting(workspace):
    with pytest.raises(ConfigError, match="candidates"):
        rederive_brought(workspace, {"horizons": ENTRY["horizons"]})
