"""Admission: a chain that is proved again, and twenty ways in which it is not (P20)."""

import json
import re
import shutil

import evidence
import pytest

from gates.proof import STAGE_REQUIRES, admit, judge, prove_all
from gates.report import report_bytes, report_path
from genpolicy.errors import ConfigError, IntegrityError, RefusedError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.hashing import sha256_file

HASH = "[0-9a-f]{16}…"
"""A hash as it is printed: enough of it to find the file by."""


def _edit_report(root, gate, change):
    path = root / report_path(gate)
    report = json.loads(path.read_bytes())
    change(report)
    path.write_text(json.dumps(report, sort_keys=True, indent=2))


def test_a_true_chain_admits_and_names_its_candidates(ladder):
    admission = admit("card", ladder)
    assert list(admission.reports) == ["A", "B", "C", "D"]
    assert admission.candidates == ("diffusion", "flow")
    assert set(admission.hashes) == set("ABCD")


def test_stages_before_a_gate_and_gate_stages_need_nothing(tmp_path):
    for stage, needed in STAGE_REQUIRES.items():
        if needed is None:
            assert admit(stage, tmp_path).reports == {}


def test_a_chain_that_does_not_hold_is_a_verdict_of_gate_e_and_no_error(ladder):
    """What lies below a card is refused by name on its page; nobody signs, and nothing breaks."""
    (ladder / report_path("B")).unlink()
    report = judge(ladder, "E")
    (below,) = [c for c in report.criteria if c.id == "upstream_passed"]
    assert below.verdict == "FAIL" and "gate_b" in below.caveat.lower().replace(" ", "_")
    assert report.verdict == "FAIL"


def test_unknown_stage_is_a_configuration_error(tmp_path):
    with pytest.raises(ConfigError, match="one of task, record"):
        admit("deploy", tmp_path)


@pytest.mark.parametrize(
    ("stage", "gate"), [("train_generators", "A"), ("shadow", "B"), ("stress", "C"), ("card", "D")]
)
def test_a_missing_report_refuses(ladder, stage, gate):
    (ladder / report_path(gate)).unlink()
    with pytest.raises(RefusedError, match=f"Gate {gate} refuses: report is missing") as caught:
        admit(stage, ladder)
    assert caught.value.exit_code == 3
    assert f"dvc repro gate_{gate.lower()}" in str(caught.value)


def test_the_sentence_names_gate_criterion_numbers_report_and_next_step(ladder):
    evidence.write_params(ladder, evidence.set_limit("gate_a", "mode_feasible_share", 0.99))
    with pytest.raises(RefusedError, match="derived again"):
        admit("train_generators", ladder)
    _judge_again(ladder, "A")
    with pytest.raises(
        RefusedError,
        match=r"Gate A refuses: mode_feasible_share is 98 %, required >= 99 %; "
        r"see reports/gate_a\.json\. Return to",
    ):
        admit("train_generators", ladder)


def _judge_again(root, gates):
    for gate in gates:
        write_bytes(root / report_path(gate), report_bytes(judge(root, gate)))


FILES = (
    "audit/clocks.parquet",
    "audit/summary.json",
    "ingest/frames.parquet",
    "train_baselines/act/seed_0/model.safetensors",
    "train_generators/flow/seed_0/config.json",
    "reload/identity.json",
    "shadow/journal.mcap",
    "stress/rollouts.parquet",
    "stress/journals/a.mcap",
)


@pytest.mark.parametrize("name", FILES)
def test_one_flipped_bit_in_any_material_refuses(ladder, name):
    file = ladder / "artifacts" / name
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(bytes(data))
    with pytest.raises((RefusedError, IntegrityError), match=name.rsplit("/", 1)[1]):
        admit("card", ladder)


@pytest.mark.parametrize("stated", ["code", "parameters", "pipeline"])
def test_what_was_judged_by_other_code_settings_or_runs_is_named_with_both_hashes(ladder, stated):
    kind = {"pipeline": "the recorded run"}.get(stated, stated)
    edits = {
        "0" * 64: rf"{HASH}, required 0{{16}}… as judged",
        None: rf"{HASH}, required none… as judged",
    }
    name = next(iter(json.loads((ladder / report_path("A")).read_bytes())[stated]))
    for digest, said in edits.items():
        _edit_report(
            ladder, "A",
            lambda r, d=digest: r[stated].update({name: d}) if d else r[stated].pop(name),
        )  # fmt: skip
        with pytest.raises(RefusedError, match=rf"{kind} of {re.escape(name)} is {said}; "):
            admit("train_generators", ladder)
    _edit_report(ladder, "A", lambda r: r[stated].update({"no/such.py": "1" * 64}))
    wrong = rf"{kind} of (no/such\.py is none…|{re.escape(name)} is {HASH}), required "
    with pytest.raises(RefusedError, match=wrong):
        admit("train_generators", ladder)


def test_a_material_that_changed_is_named_with_both_hashes_and_the_stage_that_makes_it(ladder):
    file = ladder / "artifacts/audit/clocks.parquet"
    file.write_bytes(file.read_bytes() + b" ")
    name = r"sha256 of artifacts/audit/clocks\.parquet"
    said = rf"{name} is {HASH}, required {HASH}; .*Run `dvc repro audit`"
    with pytest.raises(RefusedError, match=said):
        admit("train_generators", ladder)


def test_a_removed_or_added_material_refuses(ladder):
    file = ladder / "artifacts/train_generators/flow/seed_0/model.safetensors"
    other = ladder / "artifacts/train_generators/flow/seed_1/model.safetensors"
    other.parent.mkdir()
    shutil.copy(file, other)
    with pytest.raises(RefusedError, match="seed_1"):
        admit("shadow", ladder)
    shutil.rmtree(other.parent)
    file.unlink()
    with pytest.raises(RefusedError, match="not readable"):
        admit("shadow", ladder)


def test_a_link_in_place_of_a_material_refuses(ladder):
    file = ladder / "artifacts/audit/clocks.parquet"
    file.rename(file.with_suffix(".moved"))
    file.symlink_to(file.with_suffix(".moved"))
    with pytest.raises((RefusedError, IntegrityError), match="clocks"):
        admit("train_generators", ladder)


def _failing_a(root):
    evidence.edit_table(root, "audit/clocks.parquet", evidence.lags_apart)
    _judge_again(root, "A")


@pytest.mark.parametrize(
    "forge",
    [
        lambda r: r.update(verdict="PASS"),
        lambda r: r.update(verdict="PASS", diagnosis="", decision="go on"),
        lambda r: r.update(criteria=[]),
        lambda r: r.update(criteria=[c for c in r["criteria"] if c["verdict"] == "PASS"]),
        lambda r: [c.update(verdict="PASS") for c in r["criteria"]] and r.update(verdict="PASS"),
        lambda r: [c.update(threshold=-1e9) for c in r["criteria"] if c["comparison"] == ">="],
        lambda r: [c.update(measured=1e9) for c in r["criteria"] if c["comparison"] == ">="],
        lambda r: r["materials"].popitem(),
        lambda r: r["materials"].update({"../outside": "0" * 64}),
        lambda r: r["upstream"].update({"A": "0" * 64}),
        lambda r: r.update(caveats=[]),
        lambda r: r["settings"].update(strata_level=0.001),
    ],
)
def test_an_edited_report_refuses(ladder, forge):
    _failing_a(ladder)
    _edit_report(ladder, "A", forge)
    with pytest.raises(RefusedError):
        admit("train_generators", ladder)


@pytest.mark.parametrize("absolute", [False, True])
def test_a_material_outside_the_repository_refuses_though_its_hash_is_true(ladder, absolute):
    outside = ladder.parent / "outside.txt"
    outside.write_text("x")
    name = str(outside) if absolute else "../outside.txt"
    _edit_report(ladder, "A", lambda r: r["materials"].update({name: sha256_file(outside)}))
    with pytest.raises(RefusedError, match="outside the repository"):
        admit("train_generators", ladder)


def test_a_promotion_written_by_hand_refuses(ladder):
    evidence.edit_table(
        ladder, "stress/rollouts.parquet", lambda f: f.assign(success=f["method"] == "bc")
    )
    _judge_again(ladder, "D")
    _edit_report(
        ladder, "D", lambda r: r.update(verdict="PASS", decision="promote flow", promoted="flow")
    )
    with pytest.raises(RefusedError, match="derived again"):
        admit("card", ladder)


def test_another_environment_refuses(ladder):
    _edit_report(ladder, "A", lambda r: r["environment"].update(numpy="0.1"))
    with pytest.raises(RefusedError, match=r"environment\.numpy is .0\.1"):
        admit("train_generators", ladder)


def test_a_report_of_another_gate_or_another_run_refuses(ladder, repo):
    shutil.copy(ladder / report_path("A"), ladder / report_path("B"))
    with pytest.raises(IntegrityError, match="gate B"):
        admit("shadow", ladder)
    evidence.edit_table(repo, "audit/clocks.parquet", lambda f: f.assign(offset_after_s=0.003))
    _judge_again(repo, "AB")
    shutil.copy(repo / report_path("B"), ladder / report_path("B"))
    with pytest.raises(RefusedError, match=r"reports/gate_a\.json"):
        admit("shadow", ladder)


def test_judging_below_again_voids_what_stands_above(ladder):
    evidence.edit_table(ladder, "audit/clocks.parquet", lambda f: f.assign(offset_after_s=0.003))
    _judge_again(ladder, "A")
    with pytest.raises(
        RefusedError,
        match=rf"sha256 of reports/gate_a\.json is {HASH}, required {HASH}; .*judged again since",
    ):
        admit("shadow", ladder)


def test_every_verdict_but_pass_refuses(ladder):
    evidence.edit_document(ladder, "reload/identity.json", lambda d: {"other": {}})
    _judge_again(ladder, "B")
    with pytest.raises(RefusedError, match="not measured"):
        admit("shadow", ladder)


@pytest.mark.parametrize("verdict", ["FAIL", "INCONCLUSIVE"])
def test_a_gate_that_truly_does_not_pass_is_refused_by_its_code(ladder, verdict):
    if verdict == "FAIL":
        evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    else:
        evidence.replace(ladder, "audit/strata.parquet", None)
    write_bytes(ladder / report_path("A"), report_bytes(judge(ladder, "A")))
    rung = next(rung for rung in prove_all(ladder) if rung.gate == "A")
    assert (rung.verdict, rung.exit_code) == (verdict, 3)


def test_prove_all_reports_each_rung(ladder):
    rungs = {rung.gate: rung for rung in prove_all(ladder)}
    assert [rungs[g].verdict for g in "ABCD"] == ["PASS"] * 4
    assert rungs["E"].verdict == "NOT JUDGED"
    assert [rungs[g].exit_code for g in "ABCDE"] == [0, 0, 0, 0, 3]
    _edit_report(ladder, "C", lambda r: r.update(decision="go"))
    rungs = {rung.gate: rung for rung in prove_all(ladder)}
    assert rungs["C"].verdict == "REFUSED"
    assert rungs["D"].verdict == "REFUSED"
    assert [rungs[g].exit_code for g in "ABCDE"] == [0, 0, 3, 3, 3]
