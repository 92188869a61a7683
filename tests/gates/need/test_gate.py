"""Gate A as a whole: nothing waives the cause, and every red number of the data stops it."""

from dataclasses import fields

import evidence
import numpy as np
import pytest
from editing import cells

from gates.cause import default_limits, name_cause
from gates.criterion import Criterion
from gates.more import HARDLY, INSIDE
from gates.need import cause
from gates.need.settings import NeedSettings
from gates.proof import SPECS, judge
from gates.settings import read_params
from genpolicy.audit.rows import Finding
from genpolicy.errors import ConfigError
from genpolicy.integrity.rows import write_rows

DEFECTS = {
    "units": ("unit", "hole_pose", "magnitude_factor", 1000.0),
    "units by gain": ("unit", "action", "gain_factor", 1000.0),
    "frames": ("frame", "epoch_2", "frame_angle_rad", 0.5),
    "swapped columns": ("swapped_columns", "action", "swapped_columns", 2.0),
    "copies": ("duplicate", "", "faulty_episodes_share", 0.1),
    "freezes": ("frozen", "camera", "frozen_s", 1.0),
    "lost frames": ("gaps", "camera", "gap_share", 0.05),
    "boundaries": ("glued", "", "faulty_episodes_share", 0.1),
}


def _set(key, value):
    return lambda document: document.__setitem__(key, value)


def find(root, kind, variable, question, measured):
    """A finding of the audit, as it writes one."""
    row = Finding(
        kind=kind, variable=variable, where="somewhere", question=question, measured=measured,
        floor=0.0, unit="", action="Repair it.",
    )  # fmt: skip
    write_rows(root / "artifacts/audit/findings.parquet", Finding, [row])
    evidence.record(root)


def contaminated(root):
    """More labels disagree with the replay than the limit allows."""
    evidence.edit_table(root, "audit/replay.parquet", cells("replayed", "failure", share=0.75))


def verdicts(report):
    return {answer.id: answer.verdict for answer in report.criteria}


def test_the_cause_is_named_once_for_all_who_ask_and_counts_as_read_by_each(ladder, monkeypatch):
    named = []
    monkeypatch.setattr(cause, "name_cause", lambda *given: named.append(1) or name_cause(*given))
    report = judge(ladder, "A")
    assert len(named) == 1
    asking = {answer.id: set(answer.evidence) for answer in report.criteria}
    draws = "artifacts/audit/resamples.parquet"
    assert [draws in asking[name] for name in ("cause_accepted", "data_defects")] == [True, True]


@pytest.mark.parametrize("name", list(DEFECTS))
def test_each_kind_of_defect_fails_the_gate(ladder, name):
    kind, variable, question, measured = DEFECTS[name]
    assert judge(ladder, "A").verdict == "PASS"
    find(ladder, kind, variable, question, measured)
    report = judge(ladder, "A")
    assert report.verdict == "FAIL"
    assert verdicts(report)["data_defects"] == verdicts(report)["cause_accepted"] == "FAIL"
    (answer,) = [c for c in report.criteria if c.id == "data_defects"]
    assert answer.measured == 1.0 and kind.replace("_", " ") in answer.caveat
    assert "data_defects" in report.diagnosis


def test_labels_that_disagree_with_the_replay_are_a_defect(ladder):
    contaminated(ladder)
    report = judge(ladder, "A")
    assert report.verdict == "FAIL" and verdicts(report)["data_defects"] == "FAIL"


def test_a_defect_is_red_also_where_no_mode_persists_and_recovery_differs(ladder):
    """What passed before: cause data_defect(unit), no persistent mode, a mode that recovers."""
    evidence.edit_document(ladder, "audit/persistence.json", _set("observed", 0.55))
    evidence.edit_table(
        ladder, "audit/recovery.parquet",
        lambda f: f.assign(episodes=400, successes=f["mode"].map({"left": 400, "right": 0})),
    )  # fmt: skip
    report = judge(ladder, "A")
    assert report.verdict == "FAIL" and verdicts(report)["persistence_margin"] == "FAIL"
    assert verdicts(report)["data_defects"] == "PASS"
    find(ladder, *DEFECTS["units"])
    report = judge(ladder, "A")
    assert report.verdict == "FAIL" and "Cause found by the audit: data_defect(" in report.diagnosis
    assert verdicts(report)["data_defects"] == verdicts(report)["cause_accepted"] == "FAIL"


def test_recovery_is_no_way_into_a_pass(ladder):
    """Decision 43: a criterion, limit or setting of its own would be the second way again."""
    params, said = read_params(ladder)["gate_a"], judge(ladder, "A").model_dump_json()
    limits = [name for entries in params["limits"].values() for name in entries]
    named = {*(item.id for item in SPECS["A"].criteria), *NeedSettings.model_fields, *limits}
    assert len(named) > 30 and not [n for n in named if "recover" in n or "route" in n]
    assert "route" not in said and not {f.name for f in fields(Criterion)} & {"route", "routes"}


@pytest.mark.parametrize("key", ["routes", "limits.model.recovery_benefit_lower"])
def test_a_setting_of_a_route_is_unknown(ladder, key):
    *place, name = key.split(".")

    def add(params):
        section = params["gate_a"]
        for part in place:
            section = section[part]
        section[name] = [0.1, "a second way"]

    evidence.write_params(ladder, add)
    with pytest.raises(ConfigError, match=name):
        judge(ladder, "A")


def test_a_number_that_keeps_its_limit_is_no_defect(ladder):
    find(ladder, "frame", "epoch_2", "frame_angle_rad", 0.14)
    report = judge(ladder, "A")
    assert report.verdict == "PASS" and verdicts(report)["data_defects"] == "PASS"


@pytest.mark.parametrize("name", ["data_defects", "cause_accepted"])
def test_the_cause_cannot_be_declared_not_applicable(ladder, name):
    def waive(params):
        for entries in params["gate_a"]["limits"].values():
            entries.pop(name, None)
        params["gate_a"]["not_applicable"] = {"model": {name: "we know our data"}}

    evidence.write_params(ladder, waive)
    with pytest.raises(Exception, match=name):
        judge(ladder, "A")


def _waived(ladder, name, owner="perception"):
    def waive(params):
        for entries in params["gate_a"]["limits"].values():
            entries.pop(name, None)
        params["gate_a"]["not_applicable"] = {owner: {name: "we know our data"}}

    evidence.write_params(ladder, waive)


def test_a_criterion_of_the_labels_that_is_waived_does_not_switch_off_the_defect(ladder):
    contaminated(ladder)
    _waived(ladder, "label_disagreement", "model")
    report = judge(ladder, "A")
    assert "label_disagreement" not in verdicts(report) and report.verdict == "FAIL"
    assert verdicts(report)["data_defects"] == verdicts(report)["cause_accepted"] == "FAIL"
    (answer,) = [c for c in report.criteria if c.id == "data_defects"]
    assert "label_disagreement is waived, and asked here by the packaged limit" in answer.caveat


@pytest.mark.parametrize("question", ["clock_residual_s", "calibration_residual_m"])
def test_a_waived_question_keeps_the_packaged_limit_where_the_data_answer_it(ladder, question):
    _waived(ladder, question)
    assert judge(ladder, "A").verdict == "PASS"
    limit = default_limits()[question]
    find(ladder, "clock", "camera", question, limit)
    assert judge(ladder, "A").verdict == "PASS"
    find(ladder, "clock", "camera", question, 1.01 * limit)
    assert verdicts(judge(ladder, "A"))["data_defects"] == "FAIL"


def test_where_a_simpler_policy_may_do_the_page_sends_nobody_to_the_data(ladder):
    evidence.edit_table(
        ladder,
        "measure_baselines/modes.parquet",
        lambda f: f.assign(valid=f["samples"], modes_valid=1, admissible=f["samples"]),
    )
    report = judge(ladder, "A")
    assert report.verdict == "FAIL"
    assert "run the simpler policy" in report.diagnosis
    assert "Train the simple baselines" not in report.diagnosis
    evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    assert "run the simpler policy" not in judge(ladder, "A").diagnosis


@pytest.mark.parametrize(
    ("every", "told", "following"),
    [
        (3, "about 1.8 times as many (30 episodes now) show that it holds",
         "record more episodes, to know whether the simpler policy bc_noise is enough"),
        (2, f"{HARDLY} (30 episodes now) may not decide",
         "try the simpler policy bc_noise: it is about as good"),
    ],
)  # fmt: skip
def test_where_it_is_open_whether_a_simpler_policy_does_nobody_is_told_to_take_it(
    ladder, every, told, following
):
    """Valid in a third or in half of the situations, where at most half may be."""
    hit = evidence.NAMED[::every]
    evidence.edit_table(
        ladder,
        "measure_baselines/modes.parquet",
        lambda f: f.assign(
            **{
                key: np.where((f["method"] == "bc_noise") & f["index"].isin(hit), 16, f[key])
                for key in ("admissible", "valid")
            }
        ),
    )
    report = judge(ladder, "A")
    assert verdicts(report)["remedy_valid_share"] == report.verdict == "INCONCLUSIVE"
    assert f"Next: {following}" in report.diagnosis
    assert "run the simpler policy" not in report.diagnosis
    assert f"({INSIDE}: {told}" in report.diagnosis
    assert "If it turns out to be broken: Baselines:" in report.diagnosis


def _independent(entries):
    return [{**entry, "exceeding": entry["permutations"] // 2} for entry in entries]


def test_a_latent_that_answers_nothing_sends_nobody_to_train_what_was_trained(ladder):
    evidence.edit_document(ladder, "measure_baselines/latent.json", _independent)
    report = judge(ladder, "A")
    assert {name for name, verdict in verdicts(report).items() if verdict != "PASS"} == {
        "latent_dependence_p"
    }
    assert "Train the simple baselines" not in report.diagnosis
    assert "run the simpler policy" not in report.diagnosis
    assert "neither a strategy nor a style" in report.diagnosis
    assert "record more episodes to tell" in report.diagnosis
    evidence.edit_table(
        ladder,
        "measure_baselines/modes.parquet",
        lambda f: f.assign(valid=f["samples"], modes_valid=1, admissible=f["samples"]),
    )
    report = judge(ladder, "A")
    assert verdicts(report)["remedy_valid_share"] == "FAIL"
    assert "run the simpler policy" in report.diagnosis
    assert "Train the simple baselines" not in report.diagnosis


def test_a_pass_says_first_that_one_mode_may_be_enough(ladder):
    report = judge(ladder, "A")
    assert report.verdict == "PASS" and "one_mode_bc" in report.diagnosis
    assert "one_mode_bc" in report.caveats[0]


def test_a_pass_names_the_modes_that_it_does_not_speak_of(ladder):
    """The tool turns in two ways as well: nobody looked whether that succeeds."""
    assert any("looked for in" in caveat for caveat in judge(ladder, "A").caveats)
    turned = {"two_mode": 60, "two_mode_episodes": 30, "state": "varies"}
    evidence.edit_table(
        ladder,
        "audit/components.parquet",
        lambda f: f.assign(
            **{
                key: np.where(f["component"] == "rotation", new, f[key])
                for key, new in turned.items()
            }
        ),
    )
    report = judge(ladder, "A")
    assert report.verdict == "PASS"
    [said] = [caveat for caveat in report.caveats if "others were found" in caveat]
    assert "the modes of position" in said and "rotation (30 episodes)" in said
