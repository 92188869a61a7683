"""Convergence: what the last quarter of a training still changes, and of whom it is asked."""

import evidence
import pytest
from asked import found_in, red
from editing import cells

from gates.proof import judge

MODES = "reload/modes.parquet"
EARLIER = "reload/modes_earlier.parquet"


def _train(root, stage, method, fall):
    path = f"{stage}/{method}/seed_0/validation.parquet"
    evidence.table(root, path, evidence.ValidationRow, evidence.validation(fall))
    evidence.record(root)


@pytest.mark.parametrize("better", [EARLIER, MODES], ids=["lost", "gained"])
def test_a_candidate_whose_samples_still_change_is_red(ladder, better):
    other = MODES if better == EARLIER else EARLIER
    evidence.edit_table(ladder, other, cells("valid", 12))
    report = judge(ladder, "B")
    assert red(report) == {"late_change_upper"}
    found = found_in(report, "late_change_upper")[0]
    assert found.measured == pytest.approx(0.25) and found.interval == (0.25, 0.25)
    assert f"valid samples {'-' if better == EARLIER else '+'}25 points" in found.caveat
    assert "last quarter of 4000 updates, 20 held-out episodes" in found.caveat


def test_the_worse_end_of_the_change_decides(ladder):
    """Half of the situations gain a quarter and half nothing: .125 on average is not below .15."""
    evidence.edit_table(ladder, EARLIER, lambda f: f.assign(valid=16 - 4 * (f["index"] % 2)))
    report = judge(ladder, "B")
    assert (report.verdict, red(report)) == ("INCONCLUSIVE", set())
    found = found_in(report, "late_change_upper")[0]
    assert found.verdict == "INCONCLUSIVE"
    assert found.interval[0] < 0.125 < 0.15 < found.interval[1] == found.measured


def test_the_worse_end_of_a_loss_of_samples_decides(ladder):
    """Half of the situations lose a quarter: the lower end lies further away than the change."""
    evidence.edit_table(ladder, MODES, lambda f: f.assign(valid=16 - 4 * (f["index"] % 2)))
    found = found_in(judge(ladder, "B"), "late_change_upper")[0]
    assert found.verdict == "INCONCLUSIVE" and "valid samples -12.5 points" in found.caveat
    assert found.interval[0] < 0.125 < 0.15 < found.interval[1] == found.measured


def test_few_situations_cannot_show_that_nothing_changes(ladder):
    found = found_in(judge(ladder, "B"), "late_change_upper")[0]
    assert found.verdict == "PASS" and found.interval[0] == 0.0
    assert found.measured == pytest.approx(1 - 0.025 ** (1 / 30))

    def ten(frame):
        return frame[frame["index"].isin(evidence.NAMED[:10])]

    evidence.edit_table(
        ladder, "audit/neighbourhoods.parquet",
        lambda f: f.assign(two_mode=f["index"].isin(evidence.NAMED[:10])),
    )  # fmt: skip
    for table in (MODES, EARLIER):
        evidence.edit_table(ladder, table, ten)
    found = found_in(judge(ladder, "B"), "late_change_upper")[0]
    assert found.verdict == "INCONCLUSIVE" and found.interval[0] == 0.0


def test_the_training_seed_that_changes_most_decides(ladder):
    def second_seed(valid):
        return lambda f: evidence.pd.concat([f, f.assign(seed=1, valid=valid)], ignore_index=True)

    evidence.edit_table(ladder, MODES, second_seed(16))
    evidence.edit_table(ladder, EARLIER, second_seed(8))
    found = found_in(judge(ladder, "B"), "late_change_upper")[0]
    assert found.verdict == "FAIL" and found.measured == pytest.approx(0.5)


@pytest.mark.parametrize(
    "change",
    [
        lambda f: f[f["index"] > evidence.NAMED[0]],
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
    assert {c.verdict for c in found_in(report, "late_change_upper")} == {"INCONCLUSIVE"}


def test_a_gain_over_a_baseline_that_still_learns_is_none(ladder):
    _train(ladder, "train_baselines", "act", 0.2)
    report = judge(ladder, "B")
    assert red(report) == {"baseline_fall_upper"}
    caveat = found_in(report, "baseline_fall_upper")[0].caveat
    assert all(name in caveat for name in ("chunked_bc 4 %", "; bc 4 %", "; act 20 %"))


def test_the_worse_end_over_episodes_decides(ladder):
    """Half of the episodes gain nothing and half much: .08 on average is not below .1."""
    rows = evidence.validation(0.0)
    for row in rows:
        if row["updates"] == evidence.UPDATES and int(row["episode_uuid"][1:]) % 2:
            row["loss"] *= 0.84
    path = "train_baselines/act/seed_0/validation.parquet"
    evidence.table(ladder, path, evidence.ValidationRow, rows)
    evidence.record(ladder)
    report = judge(ladder, "B")
    assert (report.verdict, red(report)) == ("INCONCLUSIVE", set())
    found = found_in(report, "baseline_fall_upper")
    assert found and all(c.interval[0] < 0.08 and c.verdict == "INCONCLUSIVE" for c in found)


@pytest.mark.parametrize(
    "change",
    [
        lambda rows: [row for row in rows if row["updates"] != 3000],
        lambda rows: [row for row in rows if row["updates"] != 4000],
        lambda rows: [row for row in rows if (row["updates"], row["episode_uuid"]) != (3000, "e3")],
        lambda rows: [{**row, "windows": 32 + (row["updates"] == 4000)} for row in rows],
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
    assert {c.verdict for c in found_in(report, "late_change_upper")} == {"INCONCLUSIVE"}


def test_a_trained_baseline_without_its_loss_is_inconclusive_one_without_training_is_named(ladder):
    folder = ladder / "artifacts/train_baselines/act/seed_0"
    (folder / "validation.parquet").unlink()
    report = judge(ladder, "B")
    assert report.verdict == "INCONCLUSIVE"
    assert "while act was trained" in found_in(report, "baseline_fall_upper")[0].caveat
    (folder / "model.safetensors").unlink()
    evidence.record(ladder)
    report = judge(ladder, "B")
    # Weights that are gone are no sign that nothing was trained: the account of it says so.
    assert report.verdict == "INCONCLUSIVE"
    assert "while act was trained" in found_in(report, "baseline_fall_upper")[0].caveat
    evidence.edit_document(
        ladder, "train_baselines/matched.json", lambda d: d["methods"].pop("act") and d
    )
    found = found_in(judge(ladder, "B"), "baseline_fall_upper")[0]
    assert (found.verdict, "no training of its own: act" in found.caveat) == ("PASS", True)


def _of_act(ladder, seeds):
    """Losses of the baseline, by training seed: how far they fall, and of how many episodes."""
    folder = ladder / "artifacts/train_baselines/act"
    for seed, (fall, episodes) in enumerate(seeds):
        (folder / f"seed_{seed}").mkdir(exist_ok=True)
        (folder / f"seed_{seed}/model.safetensors").write_bytes(b"x")
        rows = [r for r in evidence.validation(fall) if int(r["episode_uuid"][1:]) < episodes]
        path = f"train_baselines/act/seed_{seed}/validation.parquet"
        evidence.table(ladder, path, evidence.ValidationRow, rows)
    # Everybody is measured on the same windows: who has fewer is compared with those that have.
    known = {f"e{number}" for number in range(max(episodes for _, episodes in seeds))}
    for other in sorted((ladder / "artifacts/train_baselines").glob("*/seed_0/validation.parquet")):
        table = other.relative_to(ladder / "artifacts").as_posix()
        evidence.edit_table(ladder, table, lambda f: f[f["episode_uuid"].isin(known)])
    evidence.record(ladder)
    return found_in(judge(ladder, "B"), "baseline_fall_upper")[0]


@pytest.mark.parametrize("falls", [(0.02, 0.2), (0.2, 0.02)])
def test_the_training_seed_whose_loss_falls_most_decides(ladder, falls):
    found = _of_act(ladder, [(fall, 20) for fall in falls])
    assert found.verdict == "FAIL" and found.measured >= 0.2


def test_two_episodes_are_enough_to_measure_and_one_is_not(ladder):
    assert _of_act(ladder, [(0.04, 2)]).verdict != "INCONCLUSIVE"
    assert _of_act(ladder, [(0.04, 1)]).verdict == "INCONCLUSIVE"


def test_a_loss_that_rises_is_no_fall(ladder):
    found = _of_act(ladder, [(-0.2, 20)])
    assert "act -20 %" in found.caveat and found.verdict == "PASS"
