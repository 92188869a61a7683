"""Gate B in particular: what pins a candidate, what covers a mode, what a training still gains."""

import evidence
import pytest
from editing import cells

from gates.proof import judge
from genpolicy.statistics.intervals import clopper_pearson

MODES = "reload/modes.parquet"
EARLIER = "reload/modes_earlier.parquet"


def _found(report, name):
    return [c for c in report.criteria if c.id == name]


def _red(report):
    return {c.id for c in report.criteria if c.verdict == "FAIL"}


def test_a_candidate_of_another_dataset_is_not_pinned(ladder):
    evidence.document(ladder, "ingest/manifest.json", {"schema_version": 2})
    report = judge(ladder, "B")
    assert report.verdict == "FAIL"
    assert "another one than the audited" in _found(report, "unpinned_items")[0].caveat


def test_a_solver_that_agrees_with_itself_but_not_with_its_definition_is_red(ladder):
    """One evaluation too often, at training and after reload: recorded and counted agree."""
    evidence.edit_table(ladder, "reload/nfe.parquet", lambda f: f.assign(recorded=9, counted=9))
    evidence.edit_table(ladder, MODES, cells("nfe", 9))
    report = judge(ladder, "B")
    assert _red(report) == {"nfe_mismatch"}
    found = _found(report, "nfe_mismatch")[0]
    assert found.measured == 1 and "8 by the definition" in found.caveat


@pytest.mark.parametrize(
    ("counted", "nearest", "red"),
    [(22, 22, False), (23, 22, True), (4, 4, False), (61, 61, False), (64, 61, True)],
)
def test_an_adaptive_solver_is_held_against_the_counts_that_it_may_take(
    ladder, counted, nearest, red
):
    """1 + 3 n up to a cap of 63; its count differs with the observation, and no other is right."""
    evidence.edit_table(
        ladder, "reload/nfe.parquet",
        lambda f: f.assign(recorded=counted, counted=counted, expected=nearest, least=4, most=61),
    )  # fmt: skip
    for table in (MODES, EARLIER):
        evidence.edit_table(ladder, table, lambda f: f.assign(nfe=4 + 3 * (f["index"] % 20)))
    report = judge(ladder, "B")
    assert _red(report) == ({"nfe_mismatch"} if red else set())
    assert "4 to 61 by the definition" in _found(report, "nfe_mismatch")[0].caveat
    evidence.edit_table(ladder, "reload/nfe.parquet", cells("recorded", counted + 3))
    assert "nfe_mismatch" in _red(judge(ladder, "B"))


def test_modes_beyond_what_an_adaptive_solver_may_take_say_nothing(ladder):
    evidence.edit_table(ladder, "reload/nfe.parquet", lambda f: f.assign(least=4, most=61))
    evidence.edit_table(ladder, MODES, cells("nfe", 64))
    report = judge(ladder, "B")
    assert "chosen NFE" in _found(report, "mode_coverage_lower")[0].caveat


@pytest.mark.parametrize("change", [{"least": 9}, {"most": 7}])
def test_an_expected_count_outside_its_definition_is_no_evidence(ladder, change):
    evidence.edit_table(ladder, "reload/nfe.parquet", lambda f: f.assign(**change))
    found = _found(judge(ladder, "B"), "nfe_mismatch")[0]
    assert found.verdict != "PASS" and "does not allow" in found.caveat


def test_a_noisy_point_policy_that_samples_between_the_modes_is_red(ladder):
    """Every mode is reached, with admissible samples enough, and 45 % lie between."""
    for table in (MODES, EARLIER):
        evidence.edit_table(
            ladder, table,
            lambda f: f.assign(
                samples=20, modes_covered=2, between_modes=9, admissible=8, fewest_admissible=4
            ),
        )  # fmt: skip
    report = judge(ladder, "B")
    assert _red(report) == {"outside_modes_upper"}
    assert "share 0.45" in _found(report, "outside_modes_upper")[0].caveat


def test_samples_far_from_every_mode_lie_outside_as_well(ladder):
    evidence.edit_table(ladder, MODES, cells("far_from_modes", 6))
    assert _red(judge(ladder, "B")) == {"outside_modes_upper"}


@pytest.mark.parametrize(("fewest", "passes"), [(0, False), (1, False), (2, True)])
def test_a_mode_counts_from_its_share_of_admissible_samples_on(ladder, fewest, passes):
    """Reached by half of the samples, a mode whose samples may not be executed is lost: 2 of 16."""
    evidence.edit_table(ladder, MODES, cells("fewest_admissible", fewest))
    report = judge(ladder, "B")
    assert (report.verdict == "PASS") is passes
    assert _red(report) == (set() if passes else {"mode_coverage_lower"})
    caveat = _found(report, "mode_coverage_lower")[0].caveat
    assert f"in {30 if passes else 0} of 30 two-mode situations" in caveat


def test_situations_of_one_episode_are_one_draw_of_the_coverage(ladder):
    """One situation a phase: thirty of ten episodes bound the share as ten draws do."""
    evidence.edit_table(
        ladder, MODES, lambda f: f.assign(episode_uuid=[f"e{i % 10}" for i in f["index"]])
    )
    found = _found(judge(ladder, "B"), "mode_coverage_lower")[0]
    lower, upper = clopper_pearson(10, 10, 0.95)
    assert found.interval == pytest.approx((lower, upper))
    assert "lower bound over 10 episodes" in found.caveat


def test_the_worst_training_seed_decides(ladder):
    def second_seed(frame):
        other = frame.assign(seed=1, fewest_admissible=0, between_modes=12)
        return evidence.pd.concat([frame, other], ignore_index=True)

    evidence.edit_table(ladder, MODES, second_seed)
    assert _red(judge(ladder, "B")) == {"mode_coverage_lower", "outside_modes_upper"}


def test_modes_counted_at_another_nfe_say_nothing(ladder):
    evidence.edit_table(ladder, MODES, cells("nfe", 4))
    report = judge(ladder, "B")
    assert report.verdict == "INCONCLUSIVE"
    assert "chosen NFE" in _found(report, "mode_coverage_lower")[0].caveat


def _train(root, stage, method, fall):
    path = f"{stage}/{method}/seed_0/validation.parquet"
    evidence.table(root, path, evidence.ValidationRow, evidence.validation(fall))
    evidence.record(root)


@pytest.mark.parametrize("better", [EARLIER, MODES], ids=["lost", "gained"])
def test_a_candidate_whose_samples_still_change_is_red(ladder, better):
    other = MODES if better == EARLIER else EARLIER
    evidence.edit_table(ladder, other, cells("valid", 12))
    report = judge(ladder, "B")
    assert _red(report) == {"late_change_upper"}
    found = _found(report, "late_change_upper")[0]
    assert found.measured == pytest.approx(0.25) and found.interval == (0.25, 0.25)
    assert f"valid samples {-0.25 if better == EARLIER else 0.25:+.4g}" in found.caveat
    assert "last quarter of 4000 updates, 20 held-out episodes" in found.caveat


def test_the_worse_end_of_the_change_decides(ladder):
    """Half of the situations gain a quarter and half nothing: .125 on average is not below .15."""
    evidence.edit_table(ladder, EARLIER, lambda f: f.assign(valid=16 - 4 * (f["index"] % 2)))
    report = judge(ladder, "B")
    assert _red(report) == {"late_change_upper"}
    found = _found(report, "late_change_upper")[0]
    assert found.interval[0] < 0.125 < 0.15 < found.interval[1] == found.measured


def test_few_situations_cannot_show_that_nothing_changes(ladder):
    found = _found(judge(ladder, "B"), "late_change_upper")[0]
    assert found.verdict == "PASS" and found.interval[0] == 0.0
    assert found.measured == pytest.approx(1 - 0.025 ** (1 / 30))

    def ten(frame):
        return frame[frame["index"] < 10]

    for table in (MODES, EARLIER):
        evidence.edit_table(ladder, table, ten)
    assert "late_change_upper" in _red(judge(ladder, "B"))


def test_the_training_seed_that_changes_most_decides(ladder):
    def second_seed(valid):
        return lambda f: evidence.pd.concat([f, f.assign(seed=1, valid=valid)], ignore_index=True)

    evidence.edit_table(ladder, MODES, second_seed(16))
    evidence.edit_table(ladder, EARLIER, second_seed(8))
    found = _found(judge(ladder, "B"), "late_change_upper")[0]
    assert found.verdict == "FAIL" and found.measured == pytest.approx(0.5)


@pytest.mark.parametrize(
    "change",
    [
        lambda f: f[f["index"] > 0],
        lambda f: f.assign(episode_uuid="other"),
        lambda f: f.assign(nfe=4),
        lambda f: f.assign(samples=0),
        lambda f: evidence.pd.concat([f, f], ignore_index=True),
    ],
    ids=["fewer", "other episodes", "other NFE", "no samples", "twice"],
)
def test_samples_that_were_not_drawn_alike_before_say_nothing(ladder, change):
    evidence.edit_table(ladder, EARLIER, change)
    report = judge(ladder, "B")
    assert report.verdict == "INCONCLUSIVE"
    assert {c.verdict for c in _found(report, "late_change_upper")} == {"INCONCLUSIVE"}


def test_a_gain_over_a_baseline_that_still_learns_is_none(ladder):
    _train(ladder, "train_baselines", "act", 0.2)
    report = judge(ladder, "B")
    assert _red(report) == {"baseline_fall_upper"}
    caveat = _found(report, "baseline_fall_upper")[0].caveat
    assert all(name in caveat for name in ("chunked_bc 0.04", "; bc 0.04", "; act 0.2"))


def test_the_worse_end_over_episodes_decides(ladder):
    """Half of the episodes gain nothing and half much: .08 on average is not below .1."""
    rows = evidence.validation(0.0)
    for row in rows:
        if row["step"] == evidence.UPDATES and int(row["episode_uuid"][1:]) % 2:
            row["loss"] *= 0.84
    path = "train_baselines/act/seed_0/validation.parquet"
    evidence.table(ladder, path, evidence.ValidationRow, rows)
    evidence.record(ladder)
    report = judge(ladder, "B")
    assert _red(report) == {"baseline_fall_upper"}
    assert all(c.interval[0] < 0.08 for c in _found(report, "baseline_fall_upper"))


@pytest.mark.parametrize(
    "change",
    [
        lambda rows: [row for row in rows if row["step"] != 3000],
        lambda rows: [row for row in rows if row["step"] != 4000],
        lambda rows: [row for row in rows if (row["step"], row["episode_uuid"]) != (3000, "e3")],
        lambda rows: [{**row, "windows": 32 + (row["step"] == 4000)} for row in rows],
        lambda rows: [row for row in rows if row["episode_uuid"] == "e3"],
        lambda rows: [{**row, "loss": 0.0} for row in rows],
        lambda rows: [*rows, rows[-1]],
    ],
    ids=[
        "no middle",
        "no end",
        "an episode less",
        "other windows",
        "one episode",
        "no loss",
        "twice",
    ],
)
def test_a_training_that_was_not_followed_is_inconclusive(ladder, change):
    for method in evidence.CANDIDATES:
        path = f"train_generators/{method}/seed_0/validation.parquet"
        evidence.table(ladder, path, evidence.ValidationRow, change(evidence.validation()))
    evidence.record(ladder)
    report = judge(ladder, "B")
    assert report.verdict == "INCONCLUSIVE"
    assert {c.verdict for c in _found(report, "late_change_upper")} == {"INCONCLUSIVE"}


def test_a_trained_baseline_without_its_loss_is_inconclusive_one_without_training_is_named(ladder):
    folder = ladder / "artifacts/train_baselines/act/seed_0"
    (folder / "validation.parquet").unlink()
    report = judge(ladder, "B")
    assert report.verdict == "INCONCLUSIVE"
    assert "while act was trained" in _found(report, "baseline_fall_upper")[0].caveat
    (folder / "model.safetensors").unlink()
    report = judge(ladder, "B")
    assert report.verdict == "PASS"
    assert "no training of its own: act" in _found(report, "baseline_fall_upper")[0].caveat


LATENCY = "latency/latency.parquet"


@pytest.mark.parametrize(("run", "seconds"), [(1, 0.004), (2, 0.004)])
def test_the_slower_of_two_runs_is_held_against_the_faster_whichever_it_is(ladder, run, seconds):
    """Of what was measured warm: cold calls and declared terms are no part of the question."""

    def change(frame):
        warm = (frame["source"] == "measured") & (frame["temperature"] == "warm")
        frame.loc[warm, "seconds"] = 0.001
        frame.loc[warm & (frame["run"] == run), "seconds"] = seconds
        frame.loc[~warm & (frame["run"] == 3 - run), "seconds"] = 9.0
        return frame

    evidence.edit_table(ladder, LATENCY, change)
    for found in _found(judge(ladder, "B"), "latency_median_ratio"):
        assert found.measured == pytest.approx(4.0)
        assert found.caveat.endswith("at 4") and found.verdict == "FAIL"


def test_a_run_that_took_no_time_was_not_measured(ladder):
    evidence.edit_table(ladder, LATENCY, cells("seconds", 0.0))
    found = _found(judge(ladder, "B"), "latency_median_ratio")[0]
    assert found.measured is None and "took no time" in found.caveat
