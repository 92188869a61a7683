"""A candidate that failed a gate is in no evidence above it: real stages, a real `dvc repro`."""

from pathlib import Path

import pytest
from ladder_workspace import edit_params, repro

from benchmarks.ladder_truth.planting import Plant, all_of, committed, table
from gates.report import read_report
from genpolicy.integrity.tables import read_table


def _on_record(stage: str, file: str, method: str, column: str, value: float) -> Plant:
    """Evidence against one method, which DVC takes for what the stage wrote."""

    def bad(frame):
        return frame.assign(**{column: frame[column].where(frame["method"] != method, value)})

    return all_of(table(f"artifacts/{stage}/{file}.parquet", bad), committed(stage))


def _methods(workspace: Path, table: str) -> set[str]:
    return set(read_table(workspace / "artifacts" / f"{table}.parquet")["method"].to_pylist())


def _said(workspace: Path, gate: str) -> dict[str, str]:
    return dict(read_report(workspace, gate)[0].candidates)


@pytest.mark.long
@pytest.mark.parametrize(
    ("gate", "criterion", "plant", "above"),
    [
        ("B", "samples_difference",
         _on_record("reload", "samples", "flow", "max_abs_difference", 0.5), "CD"),
        ("C", "stub_stale", _on_record("shadow", "stub", "flow", "stale", 1), "D"),
    ],
    ids="BC",
)  # fmt: skip
def test_who_failed_a_gate_is_in_no_evidence_above_it(
    copy: Path, gate, criterion, plant, above
) -> None:
    """Wrong before: Gate C let every generator run in the comparison, whatever it had said."""
    evidence = {"C": "shadow/candidates", "D": "stress/rollouts"}
    for name in above:
        assert {"diffusion", "flow"} <= _methods(copy, evidence[name])
    plant(copy)

    def hold_to_limit(params):  # which the small ladder relaxes
        params["stress"]["starts"] = 1
        params["monitors"] = {}  # nothing is asked of them here, and they roll out too
        owners = params[f"gate_{gate.lower()}"]["limits"].values()
        (entries,) = [entries for entries in owners if criterion in entries]
        entries[criterion][0] = 0.0

    edit_params(copy, hold_to_limit)
    outcome, ran = repro(copy, "gate_d")
    assert outcome.code == 0, outcome.sentence
    assert {"stress", "gate_d"} <= set(ran) and ("shadow" in ran) == (gate == "B")
    assert _said(copy, gate) == {"diffusion": "PASS", "flow": "FAIL"}
    for name in above:
        methods = _methods(copy, evidence[name])
        assert "diffusion" in methods and "flow" not in methods
        assert set(_said(copy, name)) == {"diffusion"}
