"""Gate stages: the report for people, the verdict for the next stage, the numbers for DVC."""

import csv
import json

import pytest

GATES = ("gate_a", "gate_b", "gate_c", "gate_d")


def judge(stage, *gates):
    for gate in gates:
        code, said = stage(gate)
        assert code == 0, said


def read(workspace, gate, name):
    return (workspace / "artifacts" / gate / name).read_bytes()


def test_each_gate_writes_its_verdict_numbers_and_table(evidence, stage) -> None:
    judge(stage, *GATES)
    for gate in GATES:
        report = json.loads((evidence / "reports" / f"{gate}.json").read_text())
        token = json.loads(read(evidence, gate, "verdict.json"))
        assert token == {key: report[key] for key in token}
        assert set(token) == {"gate", "verdict", "candidates", "materials"}
        assert token["verdict"] == "PASS"
        names = [
            f"{c['candidate']}.{c['id']}" if c["candidate"] else c["id"] for c in report["criteria"]
        ]
        written = json.loads((evidence / "reports" / f"{gate}.metrics.json").read_text())
        assert (written["verdict"], written["passes"]) == ("PASS", 1)
        assert written["candidates"] == report["candidates"]
        metrics = written["criteria"]
        assert sorted(metrics) == sorted(names)
        rows = list(csv.DictReader(read(evidence, gate, "criteria.csv").decode().splitlines()))
        assert [row["criterion"] for row in rows] == names
        for row, criterion in zip(rows, report["criteria"], strict=True):
            assert metrics[row["criterion"]] == {
                key: criterion[key] for key in ("measured", "threshold", "verdict")
            }
            assert float(row["measured"]) == pytest.approx(criterion["measured"], rel=1e-9)
            assert float(row["threshold"]) == criterion["threshold"]
            assert row["verdict"] == criterion["verdict"]
        for suffix in ("md", "html"):
            assert (evidence / "reports" / f"{gate}.{suffix}").stat().st_size > 200
    assert (evidence / "reports" / "index.html").is_file()


def test_judging_twice_gives_the_same_bytes(evidence, stage) -> None:
    judge(stage, "gate_a")
    first = {p: p.read_bytes() for p in evidence.rglob("*gate_a*/*") if p.is_file()}
    first |= {p: p.read_bytes() for p in (evidence / "reports").rglob("*") if p.is_file()}
    judge(stage, "gate_a")
    assert {p: p.read_bytes() for p in first} == first


def test_the_verdict_file_moves_with_verdict_or_evidence_and_not_with_a_limit(
    evidence, stage, edit, gate_evidence
) -> None:
    def limit(value, owner="perception", name="clock_residual_s"):
        def change(params):
            params["gate_a"]["limits"][owner][name][0] = value

        return change

    judge(stage, "gate_a")
    before = read(evidence, "gate_a", "verdict.json")
    report = (evidence / "reports" / "gate_a.json").read_bytes()
    edit(evidence, limit(0.05))
    judge(stage, "gate_a")
    assert read(evidence, "gate_a", "verdict.json") == before
    assert (evidence / "reports" / "gate_a.json").read_bytes() != report
    edit(evidence, limit(1e9, "model", "persistence_margin"))
    judge(stage, "gate_a")
    failed = json.loads(read(evidence, "gate_a", "verdict.json"))
    assert failed["verdict"] == "FAIL"
    edit(evidence, limit(0.05, "model", "persistence_margin"))
    gate_evidence.edit_document(
        evidence, "audit/persistence.json", lambda d: {**d, "null_mean": d["null_mean"] * 0.99}
    )
    judge(stage, "gate_a")
    other = json.loads(read(evidence, "gate_a", "verdict.json"))
    assert other["verdict"] == "PASS"
    assert other != json.loads(before), "other evidence is another verdict file"


def test_a_failed_gate_ends_with_0_and_its_report_says_fail(evidence, stage, edit) -> None:
    edit(
        evidence,
        lambda p: p["gate_a"]["limits"]["model"].update(persistence_margin=[1e9, "test"]),
    )
    judge(stage, "gate_a")
    report = json.loads((evidence / "reports" / "gate_a.json").read_text())
    assert report["verdict"] == "FAIL"
    metrics = json.loads((evidence / "reports" / "gate_a.metrics.json").read_text())
    assert (metrics["verdict"], metrics["passes"]) == ("FAIL", 0)
    assert metrics["criteria"]["persistence_margin"]["verdict"] == "FAIL"
    code, said = stage("train_generators")
    assert code == 3
    assert "Gate A refuses: persistence_margin is" in said


def test_missing_evidence_is_inconclusive_never_a_pass(workspace, stage) -> None:
    for gate in GATES:
        judge(stage, gate)
        token = json.loads(read(workspace, gate, "verdict.json"))
        assert token["verdict"] == "INCONCLUSIVE"
        assert token["materials"] == {}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            lambda t: t["perception"].update(clock_residuall_s=[1, "r"]),
            "gate_a.limits.perception.clock_residuall_s is a limit of no criterion",
        ),
        (lambda t: t["controller"]["lag_spread_rows"].pop(), "controller.lag_spread_rows is [1]"),
        (lambda t: t.update(me={"lag_spread_rows": [1, "r"]}), "gate_a.limits.me is no owner"),
        (lambda t: t["controller"].update(lag_spread_rows=["1", "r"]),
         "gate_a: lag_spread_rows is '1', expected <= 2"),
    ],
)  # fmt: skip
def test_a_bad_limit_is_a_bad_setting_and_leaves_no_verdict(
    evidence, stage, edit, change, sentence
) -> None:
    judge(stage, "gate_a")
    edit(evidence, lambda params: change(params["gate_a"]["limits"]))
    code, said = stage("gate_a")
    assert (code, said.count("\n")) == (2, 1), said
    assert sentence in said
    assert not (evidence / "reports" / "gate_a.json").exists()
    assert not (evidence / "artifacts" / "gate_a").exists()


def test_settings_that_cannot_be_read_lose_no_verdict(evidence, stage, edit) -> None:
    """Nothing is judged: what stands there is what it was, and is proved as ever."""
    judge(stage, "gate_a")
    kept = (evidence / "reports" / "gate_a.json", evidence / "artifacts" / "gate_a/verdict.json")
    before = [path.read_bytes() for path in kept]
    limits = {"lag_spread_rows": [float("nan"), "r"]}
    edit(evidence, lambda params: params["gate_a"]["limits"]["controller"].update(limits))
    code, said = stage("gate_a")
    assert (code, said.count("\n"), "lag_spread" in said) == (2, 1, True), said
    assert [path.read_bytes() for path in kept] == before
