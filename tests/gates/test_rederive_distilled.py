"""What a distillation took is counted again from the teacher and both trainings."""

import json

import evidence
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from gates import rederive
from gates.proof import Rung
from gates.rederive import rederived
from gates.rederive_distilled import (
    EVALUATIONS,
    GRADIENTS,
    rederive_costs,
    rederive_distilled,
)
from genpolicy.errors import RefusedError
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.policies import distillation

TRAINING = {"updates": 100, "batch_size": 8}
OF_TEACHER = {"updates": 50, "batch_size": 6}
"""Other numbers than the student's: whose windows count three times must be seen."""
GENERATORS = "artifacts/train_generators"


def _write(path, document):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(document))


def _said(root):
    teacher = root / GENERATORS / "diffusion" / "seed_0"
    weights, config = (
        sha256_bytes((teacher / name).read_bytes()) for name in ("model.safetensors", "config.json")
    )
    # by hand: 800 windows of the student and 300 of its teacher; the student looks at three
    # networks, of which one learns
    return {
        "teacher": "diffusion", "teacher_sha256": sha256_bytes(f"{weights}\n{config}\n".encode()),
        "updates": 150, "evaluations": 3 * 800 + 300, "gradients": 800 + 300,
    }  # fmt: skip


@pytest.fixture
def seeds(tmp_path):
    """A teacher and its student, as training leaves them."""
    found = [tmp_path / GENERATORS / name / "seed_0" for name in ("diffusion", "manicm")]
    for folder in found:
        _write(folder / "config.json", {"training": OF_TEACHER})
        (folder / "model.safetensors").write_bytes(folder.parent.name.encode())
    _write(found[1] / "config.json", {"training": TRAINING, "distilled": _said(tmp_path)})
    return found


@pytest.fixture
def compared(tmp_path, seeds):
    """The comparison of both, as its stage leaves it."""
    folder = tmp_path / "artifacts" / "stress"
    folder.mkdir(parents=True)
    rows = ["diffusion", "chunked_bc", "manicm", "manicm"]
    pq.write_table(pa.table({"method": rows}), folder / "rollouts.parquet")
    _write(folder / "distilled.json", {"manicm": _said(tmp_path)})
    return folder


def _edit(path, **changes):
    document = read_json(path)
    _write(path, document | {"distilled": document["distilled"] | changes})


def test_a_true_account_stands(tmp_path, seeds, compared):
    rederive_costs(tmp_path, seeds)
    rederive_distilled(tmp_path, 0)


@pytest.mark.parametrize(
    ("key", "value"),
    [("teacher_sha256", "0" * 64), ("updates", 149), ("evaluations", 2699), ("gradients", 800),
     ("unknown", 1)],
)  # fmt: skip
def test_an_account_that_the_teacher_does_not_bear_out_is_refused(tmp_path, seeds, key, value):
    _edit(seeds[1] / "config.json", **{key: value})
    with pytest.raises(RefusedError, match=rf"manicm/seed_0/config.json: distilled: {key}"):
        rederive_costs(tmp_path, seeds)


def test_a_training_that_says_nothing_of_itself_counts_for_nothing(tmp_path, seeds):
    said = {**_said(tmp_path), "updates": 50, "evaluations": 300, "gradients": 300}
    for training in ({}, {"training": {"batch_size": 8}}, {"training": 3}):
        _write(seeds[1] / "config.json", {**training, "distilled": said})
        rederive_costs(tmp_path, seeds)
    _write(seeds[1] / "config.json", {"training": {"updates": 100}, "distilled": said})
    with pytest.raises(RefusedError, match=r"distilled: updates is 50, required 150"):
        rederive_costs(tmp_path, seeds)


def test_another_teacher_in_its_folder_is_refused(tmp_path, seeds):
    (seeds[0] / "model.safetensors").write_bytes(b"trained again")
    with pytest.raises(RefusedError, match="teacher_sha256"):
        rederive_costs(tmp_path, seeds)


@pytest.mark.parametrize("teacher", ["flow", None, 3])
def test_a_teacher_that_does_not_lie_there_is_refused(tmp_path, seeds, teacher):
    _edit(seeds[1] / "config.json", teacher=teacher)
    with pytest.raises(RefusedError, match=r"distilled\.teacher"):
        rederive_costs(tmp_path, seeds)


def test_what_gate_d_prints_is_what_the_candidate_says(tmp_path, compared):
    _write(compared / "distilled.json", {"manicm": _said(tmp_path) | {"updates": 1}})
    with pytest.raises(RefusedError, match=r"distilled\.json: manicm"):
        rederive_distilled(tmp_path, 0)


def test_a_distillation_that_gate_d_does_not_mention_is_refused(tmp_path, compared):
    (compared / "distilled.json").unlink()
    with pytest.raises(RefusedError, match=r"distilled\.json: manicm"):
        rederive_distilled(tmp_path, 0)


def test_the_configuration_is_that_of_the_seed_that_is_judged(tmp_path, compared):
    with pytest.raises(RefusedError, match=r"distilled\.json: manicm .*, required None"):
        rederive_distilled(tmp_path, 1)


def test_a_distillation_of_nobody_is_refused(tmp_path, compared):
    said = {"manicm": _said(tmp_path), "flow": _said(tmp_path)}
    _write(compared / "distilled.json", said)
    with pytest.raises(RefusedError, match=r"distilled\.json: flow"):
        rederive_distilled(tmp_path, 0)


def test_both_witnesses_count_an_update_alike():
    """The gates import nothing of the trainings, so that what they say twice is held here."""
    assert EVALUATIONS == distillation.EVALUATIONS_PER_WINDOW
    assert GRADIENTS == distillation.GRADIENTS_PER_WINDOW


def test_gate_b_is_refused_where_an_account_is_wrong(repo, monkeypatch):
    """Through the proof that `genpolicy verify report` makes."""
    monkeypatch.setattr(rederive, "rederive_policies", lambda *_: None)  # nothing was trained here
    rung = Rung("B", "reproducibility", "PASS", "", "", "reports/gate_b.json", 0)
    assert rederived(repo, [rung])[0].verdict == "PASS"
    said = {"teacher": "diffusion", "teacher_sha256": "0", "updates": 1}
    evidence.document(repo, "train_generators/flow/seed_0/config.json", {"distilled": said})
    found = rederived(repo, [rung])[0]
    assert found.verdict == "REFUSED" and "distilled" in found.note
