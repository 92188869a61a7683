"""What an entry says is read before anybody is asked."""

import pytest

from genpolicy.candidates.conformance.stated import DatasetHashes, stated

DATA = DatasetHashes(manifest="a" * 64, split="b" * 64)
DECLARED = {
    "dataset": "a" * 64, "split": "b" * 64, "training_seed": 7, "architecture": "mlp",
    "parameters": 100, "path": "none", "sampler": "direct", "sampler_steps": 1, "evaluations": 1,
    "precision": "float32", "device": "cpu", "threads": 1, "cpu_capability": "AVX2",
    "batch_rows": 1,
}  # fmt: skip


@pytest.mark.parametrize(
    ("fields", "judged", "said"),
    [
        ({"files": {"w": "c" * 64}, "declared": DECLARED}, ("holds", "holds"), "this dataset"),
        ({"declared": DECLARED}, ("fails", "holds"), "this dataset"),
        ({"files": {"w": "c" * 64}}, ("holds", "fails"), "without `declared`"),
        ({"declared": {**DECLARED, "split": "c" * 64}}, ("fails", "fails"), "which is bbbb"),
        ({"declared": {**DECLARED, "dataset": "c" * 64, "split": "c" * 64}},
         ("fails", "unknown"), "unless `gate_b.unmatched` names it"),
    ],
)  # fmt: skip
def test_what_gate_b_will_read(entry_of, fields, judged, said):
    pinned, declared = stated(entry_of(**fields), DATA)
    assert (pinned.name, declared.name, pinned.gate, declared.gate) == (
        "pinned", "declared", "B", "B",
    )  # fmt: skip
    assert (pinned.judged, declared.judged) == judged
    assert said in declared.said
