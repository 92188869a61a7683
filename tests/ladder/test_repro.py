"""What runs again, and what does not, after nothing or a threshold has changed."""

import json
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pytest
import yaml
from ladder_workspace import edit_params, hashes, repro, set_limit

from gates.rederive_audit import hold_audit, measure_again
from gates.rederive_policies import rederive_policies
from gates.report import Gate
from genpolicy.errors import RefusedError
from genpolicy.integrity.tables import read_table, write_table

GATES = [f"gate_{letter}" for letter in "abcde"]
EVIDENCE = [
    "record", "ingest", "audit", "train_baselines", "measure_baselines", "train_factors",
    "measure_factors", "train_generators", "reload", "latency",
    "shadow", "wall_clock", "stress", "monitors",
]  # fmt: skip


def verdicts(workspace: Path) -> dict[str, str]:
    return {
        gate: json.loads((workspace / "reports" / f"{gate}.json").read_text())["verdict"]
        for gate in GATES
        if (workspace / "reports" / f"{gate}.json").exists()
    }


def test_the_ladder_runs_through_all_five_gates_and_waits_for_a_person(finished: Path) -> None:
    assert verdicts(finished) == {
        **dict.fromkeys(GATES[:4], "PASS"),
        "gate_e": "PENDING_REVIEW",
    }
    assert (finished / "artifacts" / "card" / "card.json").is_file()
    for gate in GATES:
        for suffix in ("json", "md", "html", "metrics.json"):
            assert (finished / "reports" / f"{gate}.{suffix}").stat().st_size > 200
        assert (finished / "reports" / gate / "criteria.csv").stat().st_size > 200
        names = {path.name for path in (finished / "artifacts" / gate).iterdir()}
        assert names == {"verdict.json", "criteria.csv"}
    assert not list((finished / "artifacts").glob(".*"))


@pytest.mark.parametrize(
    ("gate", "table", "who", "column"),
    [
        ("A", "measure_baselines/modes", "bc_noise", "valid"),
        ("A", "measure_factors/modes", "linear_encoder", "valid"),
        ("B", "reload/modes", "flow", "between_modes"),
        ("B", "reload/modes_earlier", "diffusion", "admissible"),
        ("B", "train_generators/fixtures", "diffusion", "nfe"),
    ],
)
def test_counts_are_those_that_the_checkpoints_give(
    copy: Path, gate: Gate, table: str, who: str, column: str
) -> None:
    """A forged row that is committed and judged was as good as a measured one."""
    params = yaml.safe_load((copy / "params.yaml").read_text())
    rederive_policies(gate, copy, params)
    path = copy / "artifacts" / f"{table}.parquet"
    frame = pd.read_parquet(path)
    own = frame["variant" if "variant" in frame else "method"] == who
    assert own.any()
    frame[column] = frame[column].mask(own, (frame[column] + 5) % 16).astype(frame[column].dtype)
    frame.to_parquet(path)
    with pytest.raises(RefusedError, match=rf"{who} \(seed 0\)"):
        rederive_policies(gate, copy, params)


def test_rows_of_the_audit_are_those_that_its_dataset_gives(copy: Path, tmp_path: Path) -> None:
    """Forged in every row, as somebody would who commits and judges them."""
    stated, again = copy / "artifacts/audit", tmp_path / "again"
    again.mkdir()
    measure_again(copy, yaml.safe_load((copy / "params.yaml").read_text()), again)
    hold_audit(stated, again)
    for table, column, value in (
        ("strata", "effect_upper", 0.05), ("replay", "replayed", "success"),
        ("neighbourhoods", "persistent", True), ("modes", "successes", 20),
    ):  # fmt: skip
        path = stated / f"{table}.parquet"
        before = read_table(path)
        frame = before.to_pandas().assign(**{column: value})
        write_table(path, pa.Table.from_pandas(frame, schema=before.schema, preserve_index=False))
        with pytest.raises(RefusedError, match=rf"audit/{table}\.parquet: .*: {column} is"):
            hold_audit(stated, again)
        write_table(path, before)


def test_a_second_repro_does_nothing(copy: Path) -> None:
    before = hashes(copy, "artifacts", "reports")
    lock = (copy / "dvc.lock").read_bytes()
    outcome, ran = repro(copy)
    assert (outcome.code, ran) == (0, [])
    assert hashes(copy, "artifacts", "reports") == before
    assert (copy / "dvc.lock").read_bytes() == lock
    print(f"no-op repro: {outcome.duration_s:.2f} s")


def test_judging_one_gate_again_changes_its_report_only(copy: Path) -> None:
    """A moved threshold, `dvc repro -s gate_c`: seconds, and nothing but that gate's report."""
    before = hashes(copy, "artifacts", "reports")
    set_limit(copy, "gate_c", "mode_admissible_gap", 1e8)
    outcome, ran = repro(copy, "gate_c", single_item=True)
    assert (outcome.code, ran) == (0, ["gate_c"])
    after = hashes(copy, "artifacts", "reports")
    changed = {name for name in before | after if before.get(name) != after.get(name)}
    assert changed <= {
        "reports/gate_c.json", "reports/gate_c.md", "reports/gate_c.html", "reports/index.html",
        "reports/gate_c.metrics.json", "artifacts/gate_c/criteria.csv",
        "reports/gate_c/criteria.csv",
    }  # fmt: skip
    assert "reports/gate_c.json" in changed
    print(f"re-judging one gate: {outcome.duration_s:.2f} s")


@pytest.mark.long
def test_a_threshold_within_the_same_verdict_judges_again_and_trains_nothing(copy: Path) -> None:
    evidence = [f"artifacts/{name}" for name in EVIDENCE]
    before = hashes(copy, *evidence)
    set_limit(copy, "gate_a", "clock_residual_s", 1e8)
    outcome, ran = repro(copy)
    assert outcome.code == 0, outcome.sentence
    assert not set(ran) & set(EVIDENCE), ran
    assert set(ran) >= set(GATES), "a new report below is a new upstream for every gate above"
    assert hashes(copy, *evidence) == before
    assert verdicts(copy)["gate_d"] == "PASS"


def test_an_edited_report_is_put_right_by_repro(copy: Path) -> None:
    report = copy / "reports" / "gate_b.json"
    before = report.read_bytes()
    report.write_bytes(before.replace(b'"PASS"', b'"FAIL"', 1))
    outcome, ran = repro(copy)
    assert outcome.code == 0, outcome.sentence
    assert ran == ["gate_b"]
    assert report.read_bytes() == before


@pytest.mark.long
def test_the_number_of_workers_changes_no_byte(copy: Path) -> None:
    """Two workers made the finished ladder; one makes the same recordings, dataset and audit."""
    folders = [f"artifacts/{name}" for name in ("record", "ingest", "audit")]
    before = hashes(copy, *folders)

    def one_worker(params: dict) -> None:
        assert params["compute"]["workers"] == 2
        params["compute"]["workers"] = 1

    edit_params(copy, one_worker)
    outcome, ran = repro(copy, "record", "ingest", "audit", single_item=True, force=True)
    assert (outcome.code, ran) == (0, ["record", "ingest", "audit"])
    assert hashes(copy, *folders) == before
