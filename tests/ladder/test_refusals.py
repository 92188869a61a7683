"""Whatever is untrue or not passed stops the next stage, and nothing below it is written."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ladder_workspace import (
    edit_params,
    flip_a_bit,
    hashes,
    repro,
    run_here,
    run_stage,
    set_limit,
)

from gates.report import SCHEMA_VERSION, read_report, report_bytes
from genpolicy.integrity.tables import read_table, write_table

Tamper = Callable[[Path], Any]


def edit_report(gate: str, change: Callable[[dict[str, Any]], Any]) -> Tamper:
    """Change one report in its own serialisation, so that only the content differs."""

    def tamper(workspace: Path) -> None:
        path = workspace / "reports" / f"{gate}.json"
        document = json.loads(path.read_text())
        change(document)
        path.write_text(json.dumps(document, sort_keys=True, separators=(",", ":")))

    return tamper


def flip(pattern: str) -> Tamper:
    """Flip one bit of the first file that matches; its size and times stay."""

    def tamper(workspace: Path) -> None:
        path = sorted((workspace / "artifacts").glob(pattern))[0]
        before = path.stat()
        flip_a_bit(path)
        after = path.stat()
        assert (after.st_size, after.st_mtime_ns) == (before.st_size, before.st_mtime_ns)

    return tamper


def forge_a_pass(workspace: Path) -> None:
    """Gate A fails honestly, then somebody writes PASS into its report."""
    set_limit(workspace, "gate_a", "persistence_margin", 1e9)
    assert run_here(workspace, "gate_a")[0] == 0
    report, _ = read_report(workspace, "A")
    assert report.verdict == "FAIL"
    edit_report("gate_a", lambda document: document.update(verdict="PASS"))(workspace)


def swap_candidates(document: dict[str, Any]) -> None:
    other = {"flow": "diffusion", "diffusion": "flow"}
    document["candidates"] = {other[name]: v for name, v in document["candidates"].items()}
    for criterion in document["criteria"]:
        criterion["candidate"] = other.get(criterion["candidate"], criterion["candidate"])


def swap_rollouts(workspace: Path) -> None:
    """The evidence of one candidate under the name of another."""
    path = workspace / "artifacts" / "stress" / "rollouts.parquet"
    table = read_table(path)
    other = {"flow": "diffusion", "diffusion": "flow"}
    methods = [other.get(name, name) for name in table["method"].to_pylist()]
    place = table.schema.get_field_index("method")
    write_table(path, table.set_column(place, table.schema.field(place), [methods]))


def copy_checkpoint(workspace: Path) -> None:
    generators = workspace / "artifacts" / "train_generators"
    shutil.copytree(generators / "diffusion", generators / "flow", dirs_exist_ok=True)


DERIVED = "as derived again from evidence and params.yaml"
CASES: dict[str, tuple[Tamper, str, int, str]] = {
    "bit in the dataset": (
        flip("ingest/frames.parquet"), "train_generators", 3,
        r"Gate A refuses: sha256 of artifacts/ingest/frames\.parquet is \w{16}…, required",
    ),
    "bit in the audit": (
        flip("audit/neighbourhoods.parquet"), "train_generators", 3,
        r"Gate A refuses: sha256 of artifacts/audit/neighbourhoods\.parquet is",
    ),
    "bit in a baseline": (
        flip("train_baselines/chunked_bc/seed_0/model.safetensors"), "latency", 3,
        r"Gate A refuses: sha256 of artifacts/train_baselines/chunked_bc/seed_0/model\.\w+ is",
    ),
    "bit in a generator": (
        flip("train_generators/flow/seed_0/model.safetensors"), "shadow", 3,
        r"Gate B refuses: sha256 of artifacts/train_generators/flow/seed_0/model\.safetensors is",
    ),
    "bit in the measured times": (
        flip("latency/latency.parquet"), "shadow", 3,
        r"Gate B refuses: sha256 of artifacts/latency/latency\.parquet is",
    ),
    "bit in the shadow journal": (
        flip("shadow/journal.mcap"), "stress", 3,
        r"Gate C refuses: sha256 of artifacts/shadow/journal\.mcap is",
    ),
    "bit in a stress journal": (
        flip("stress/journals/*.mcap"), "card", 3,
        r"Gate D refuses: sha256 of artifacts/stress/journals/\S+\.mcap is",
    ),
    "verdict edited": (
        forge_a_pass, "train_generators", 3,
        rf'Gate A refuses: reports/gate_a\.json\.verdict is "PASS", required "FAIL" {DERIVED}',
    ),
    "criterion deleted": (
        edit_report("gate_c", lambda d: d["criteria"].pop(0)), "stress", 3,
        rf"Gate C refuses: reports/gate_c\.json\.criteria is a list of \d+, required .*{DERIVED}",
    ),
    "measured number edited": (
        edit_report("gate_d", lambda d: d["criteria"][0].update(measured=12345.0)), "card", 3,
        rf"Gate D refuses: reports/gate_d\.json\.criteria\[0\]\S* is 12345\.0, .*{DERIVED}",
    ),
    "threshold relaxed after judging": (
        lambda w: set_limit(w, "gate_b", "nfe_mismatch", 2e9), "shadow", 3,
        # What moved since the plan is said in the caveats, which stand before the criteria.
        rf"Gate B refuses: reports/gate_b\.json\.(criteria|caveats)\[\d+\]\S* is .*{DERIVED}",
    ),
    "report missing": (
        lambda w: (w / "reports" / "gate_b.json").unlink(), "shadow", 3,
        r"Gate B refuses: report is missing, required a report",
    ),
    "older schema version": (
        edit_report("gate_a", lambda d: d.update(schema_version=0)), "train_generators", 2,
        rf"reports/gate_a\.json: schema_version is 0, expected {SCHEMA_VERSION}\. "
        r"Run `dvc repro -f gate_a`",
    ),
    "report of another gate": (
        lambda w: shutil.copy(w / "reports" / "gate_a.json", w / "reports" / "gate_b.json"),
        "shadow", 2, r"reports/gate_b\.json: gate is a report of gate A, expected gate B",
    ),
    "report of another candidate": (
        edit_report("gate_c", swap_candidates), "stress", 3,
        rf"Gate C refuses: reports/gate_c\.json\.\S+ is .*{DERIVED}",
    ),
    "checkpoint of another candidate": (
        copy_checkpoint, "shadow", 3,
        r"Gate B refuses: sha256 of artifacts/train_generators/flow/seed_0/\S+ is",
    ),
    "evidence of another candidate": (
        swap_rollouts, "card", 3,
        r"Gate D refuses: sha256 of artifacts/stress/rollouts\.parquet is",
    ),
}  # fmt: skip


APART = "evidence of another candidate"
"""The case whose stage runs in a process of its own; of the others it would say no more."""


@pytest.mark.parametrize("name", CASES)
def test_what_is_not_true_stops_the_next_stage(copy: Path, name: str) -> None:
    tamper, stage, code, sentence = CASES[name]
    tamper(copy)
    before = hashes(copy, "artifacts", "reports")
    found, said = (run_stage if name == APART else run_here)(copy, stage)
    assert (found, said[: len(stage) + 2]) == (code, f"{stage}: "), said
    assert re.search(sentence, said), said
    assert "\n" not in said
    assert hashes(copy, "artifacts", "reports") == before, "a refused stage wrote something"


def test_the_untouched_ladder_admits_every_stage(copy: Path) -> None:
    """The cases above refuse because of what was done, not because of the copy."""
    card = hashes(copy, "artifacts/card")
    code, said = run_stage(copy, "card")
    assert code == 0, said  # on a busy machine it says that it is still at it
    assert hashes(copy, "artifacts/card") == card


def test_a_flipped_bit_stops_repro_where_direct_calls_stop(copy: Path) -> None:
    """DVC does not see it (size, time and inode are the same); admission does."""
    flip("audit/summary.json")(copy)
    before = hashes(copy, "artifacts", leave=("artifacts/train_generators/",))
    outcome, ran = repro(copy, "train_generators", single_item=True, force=True)
    assert (outcome.code, outcome.stage, ran) == (3, "train_generators", ["train_generators"])
    assert "Gate A refuses: sha256 of artifacts/audit/summary.json" in outcome.sentence
    assert not (copy / "artifacts" / "train_generators").exists()
    assert hashes(copy, "artifacts") == before


def test_a_failed_gate_stops_repro_and_the_report_says_why(copy: Path) -> None:
    set_limit(copy, "gate_a", "persistence_margin", 1e9)
    evidence = hashes(
        copy,
        "artifacts/ingest",
        "artifacts/audit",
        "artifacts/train_baselines",
        "artifacts/measure_baselines",
    )
    outcome, ran = repro(copy)
    assert (outcome.code, outcome.stage) == (3, "candidates")  # the first behind the gate
    assert ran == ["gate_a"]
    assert re.search(
        r"Gate A refuses: persistence_margin is [\d.]+ %, required >= 100,000,000,000 %; "
        r"see reports/gate_a\.json",
        outcome.sentence,
    ), outcome.sentence
    assert not (copy / "artifacts" / "candidates").exists()
    assert (
        hashes(
            copy,
            "artifacts/ingest",
            "artifacts/audit",
            "artifacts/train_baselines",
            "artifacts/measure_baselines",
        )
        == evidence
    )
    report = json.loads((copy / "reports" / "gate_a.json").read_text())
    assert report["verdict"] == "FAIL"
    assert report["diagnosis"].startswith("First unmet: persistence_margin")


def unlimited(workspace: Path, gate: str) -> None:
    edit_params(workspace, lambda params: params[gate]["limits"].clear())


NO_LIMIT = "required a limit in params.yaml"


@pytest.mark.parametrize(
    ("gate", "stage"),
    [
        ("gate_a", "train_generators"),
        pytest.param("gate_c", "stress", marks=pytest.mark.long),
        ("gate_d", "failure_search"),
    ],
)
def test_an_empty_threshold_set_passes_nothing(copy: Path, gate: str, stage: str) -> None:
    unlimited(copy, gate)
    outcome, ran = repro(copy, gate, single_item=True)
    assert (outcome.code, ran) == (0, [gate])
    report = json.loads((copy / "reports" / f"{gate}.json").read_text())
    assert report["verdict"] == "INCONCLUSIVE"
    before = hashes(copy, "artifacts", "reports")
    code, said = run_here(copy, stage)
    assert (code, said[: len(stage) + 2]) == (3, f"{stage}: "), said
    assert NO_LIMIT in said, said
    assert hashes(copy, "artifacts", "reports") == before, "a refused stage wrote something"


@pytest.mark.long
def test_an_empty_threshold_set_stops_repro(copy: Path) -> None:
    unlimited(copy, "gate_b")
    outcome, ran = repro(copy, "shadow")
    assert (outcome.code, outcome.stage) == (3, "shadow")
    assert ran == ["gate_b", "shadow"]
    assert NO_LIMIT in outcome.sentence, outcome.sentence
    assert not (copy / "artifacts" / "shadow").exists()
    report = json.loads((copy / "reports" / "gate_b.json").read_text())
    assert report["verdict"] == "INCONCLUSIVE"


@pytest.mark.long
def test_lifting_the_cause_lets_the_ladder_go_on_to_the_same_bytes(copy: Path) -> None:
    before = hashes(copy, "artifacts", "reports")
    params = (copy / "params.yaml").read_bytes()
    set_limit(copy, "gate_d", "stub_violations", -1.0)
    outcome, ran = repro(copy)
    assert (outcome.code, outcome.stage) == (3, "failure_search")
    assert ran == ["gate_d", "failure_search"]
    assert not (copy / "artifacts" / "failure_search").exists()
    (copy / "params.yaml").write_bytes(params)
    outcome, _ = repro(copy)
    assert outcome.code == 0, outcome.sentence
    assert hashes(copy, "artifacts", "reports") == before


def test_reports_are_canonical(finished: Path) -> None:
    """The same report gives the same bytes, so that a hash of it means something."""
    for gate in "ABCD":
        report, _ = read_report(finished, gate)
        path = finished / "reports" / f"gate_{gate.lower()}.json"
        assert report_bytes(report) == path.read_bytes()
