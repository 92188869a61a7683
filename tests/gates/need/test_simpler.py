"""The simpler explanations: golden values, what counts as valid, what is reported only."""

import evidence
import numpy as np
import pandas as pd
import pytest

from gates.evidence import MissingEvidenceError
from gates.need.simpler import redrawn_validity, valid_share
from gates.proof import judge
from gates.recount import AtLeast
from gates.writing import write_gate
from genpolicy.statistics.intervals import clopper_pearson


def found(root, name):
    (criterion,) = [c for c in judge(root, "A").criteria if c.id == name]
    return criterion


def rows(**changes):
    base = {
        "modes_present": 2, "modes_covered": 1, "samples": 4, "admissible": 4, "episode_uuid": "e",
    }  # fmt: skip
    return pd.DataFrame([{**base, "episode_uuid": f"e{i}", **changes} for i in range(10)])


def valid_of(frame):
    return valid_share("modes", frame, AtLeast("samples", 1), confidence=0.95)


@pytest.mark.parametrize(
    ("changes", "share"),
    [
        ({}, 1.0), ({"admissible": 3}, 0.0), ({"modes_covered": 0}, 0.0),
        ({"modes_covered": 2}, 1.0),
    ],
)  # fmt: skip
def test_valid_is_a_reached_mode_and_every_sample_admissible(changes, share):
    valid = valid_of(rows(**changes))
    assert (valid.share, valid.recount.whole, valid.episodes) == (share, 10, 10)
    assert (valid.lower, valid.upper) == clopper_pearson(int(10 * share), 10, 0.95)


def test_valid_share_counts_episodes_and_only_situations_with_two_modes():
    frame = pd.concat([rows(), rows(modes_present=1)])
    valid = valid_of(frame)
    assert (valid.recount.whole, valid.episodes) == (10, 10)
    one = valid_of(rows().assign(episode_uuid="same"))
    assert (one.recount.whole, one.episodes) == (10, 1)
    assert one.lower == clopper_pearson(1, 1, 0.95)[0]
    with pytest.raises(MissingEvidenceError, match="two modes"):
        valid_of(rows(modes_present=1))


def test_a_chunk_that_reaches_a_mode_but_is_refused_has_removed_nothing(ladder):
    assert found(ladder, "chunking_valid_share").verdict == "PASS"
    evidence.edit_table(
        ladder, "measure_baselines/modes.parquet",
        lambda f: f.assign(admissible=np.where(f["method"] == "chunked_bc", 16, f["admissible"])),
    )  # fmt: skip
    criterion = found(ladder, "chunking_valid_share")
    assert criterion.verdict == "FAIL" and criterion.measured == 1.0


def test_phase_collapse_is_the_upper_bound_of_lost_episodes(ladder):
    criterion = found(ladder, "phase_collapse_share")
    assert criterion.measured == pytest.approx(clopper_pearson(2, 42, 0.95)[1], abs=1e-6)
    for without, seen, expected in ((42, 42, clopper_pearson(0, 42)[1]), (0, 0, 0.0)):
        evidence.edit_document(
            ladder, "audit/summary.json",
            lambda d, w=without, s=seen: d.update(modes_without_phase=w, modes_with_phase=s),
        )  # fmt: skip
        assert found(ladder, "phase_collapse_share").measured == pytest.approx(expected, abs=1e-6)
    # Looking inside a phase may also bring modes to light; that is no collapse.
    evidence.edit_document(
        ladder, "audit/summary.json",
        lambda d: d.update(modes_without_phase=20, modes_with_phase=40),
    )  # fmt: skip
    assert found(ladder, "phase_collapse_share").verdict == "PASS"


def test_a_latent_is_judged_by_its_worst_seed(ladder):
    assert found(ladder, "latent_dependence_p").measured == pytest.approx(
        clopper_pearson(0, 999)[1], abs=1e-6
    )
    evidence.edit_document(
        ladder,
        "measure_baselines/latent.json",
        lambda d: [*d, {**d[0], "seed": 1, "exceeding": 300}],
    )
    criterion = found(ladder, "latent_dependence_p")
    assert criterion.verdict == "INCONCLUSIVE" and criterion.interval[1] > 0.3
    evidence.edit_document(
        ladder, "measure_baselines/latent.json", lambda d: [{**d[0], "method": "other"}]
    )
    assert found(ladder, "latent_dependence_p").verdict == "INCONCLUSIVE"


@pytest.mark.parametrize("factor", ["trunk", "head", "temporal", "representation"])
def test_a_factor_that_no_variant_changes_is_missing(ladder, factor):
    def drop(document):
        variants = document["variants"]
        document["variants"] = {k: v for k, v in variants.items() if v["factor"] != factor}

    evidence.edit_document(ladder, "train_factors/variants.json", drop)
    criterion = found(ladder, "factors_isolated")
    assert criterion.verdict == "INCONCLUSIVE" and factor in criterion.caveat


def test_only_conditioning_factors_can_remove_the_mean(ladder):
    for name, verdict in (("energy_head", "PASS"), ("single_action", "PASS"),
                          ("linear_encoder", "FAIL")):  # fmt: skip
        evidence.edit_table(
            ladder, "measure_factors/modes.parquet",
            lambda f, n=name: f.assign(
                admissible=np.where(f["variant"] == n, f["samples"], f["admissible"])
            ),
        )  # fmt: skip
        assert found(ladder, "factor_valid_share").verdict == verdict, name


def test_the_page_draws_the_factors_and_says_what_ibc_is(ladder):
    write_gate(ladder, "A")
    page = (ladder / "reports/gate_a.html").read_text()
    assert "What each part earns, changed alone" in page
    assert "transformer" in page and "An energy policy (IBC)" in page
    evidence.replace(ladder, "measure_factors/effects.parquet", None)
    write_gate(ladder, "A")
    assert (
        "Not drawn: artifacts/measure_factors/effects.parquet is missing"
        in (ladder / "reports/gate_a.html").read_text()
    )


SAMPLED = {"samples": 16, "admissible": 4, "valid": 2}


@pytest.mark.parametrize(
    ("changes", "chance"),
    [
        ({"admissible": 16, "valid": 16}, 1.0), ({"admissible": 0, "valid": 0}, 0.0),
        # 1 - C(12, 4) / C(16, 4) = 1 - 495 / 1820, and half of what passes is in a mode.
        ({}, 0.5 * (1 - 495 / 1820)), ({"valid": 4}, 1 - 495 / 1820),
        ({"samples": 2, "admissible": 1, "valid": 1}, 1.0),
    ],
)  # fmt: skip
def test_golden_chance_that_a_redrawn_sample_is_valid(changes, chance):
    frame = pd.DataFrame([{**SAMPLED, **changes}])
    assert redrawn_validity(frame, redraws=4)[0] == pytest.approx(chance)


def test_the_chance_is_that_of_drawing_without_replacement():
    """By simulation: four of sixteen samples in random order, the first admissible one counts."""
    rng = np.random.default_rng(0)
    passed, valid = np.arange(16) < 4, np.arange(16) < 2
    hits = 0
    for _ in range(20_000):
        drawn = rng.permutation(16)[:4]
        first = next((k for k in drawn if passed[k]), None)
        hits += first is not None and bool(valid[first])
    expected = redrawn_validity(pd.DataFrame([SAMPLED]), redraws=4)[0]
    assert hits / 20_000 == pytest.approx(expected, abs=0.01)


def test_more_valid_than_admissible_samples_are_no_evidence():
    for wrong in ({"valid": 5}, {"admissible": 17}, {"valid": -1}):
        with pytest.raises(MissingEvidenceError, match="no part"):
            redrawn_validity(pd.DataFrame([{**SAMPLED, **wrong}]), redraws=4)


def test_one_mode_is_shown_and_left_to_motion(ladder):
    """Each mode is valid, so one of them is: a limit here is one that no task with modes meets."""
    evidence.edit_table(
        ladder, "measure_baselines/modes.parquet",
        lambda f: f.assign(**{
            key: np.where(f["method"] == "one_mode_bc", 16, f[key])
            for key in ("admissible", "valid")
        }),
    )  # fmt: skip
    criterion = found(ladder, "remedy_valid_share")
    assert (
        criterion.verdict == "PASS"
        and "one_mode_bc in 100 % (shown, not judged" in criterion.caveat
    )


@pytest.mark.parametrize("name", ["chunked_l1", "bc_noise"])
def test_each_remedy_that_acts_validly_fails_the_gate(ladder, name):
    assert found(ladder, "remedy_valid_share").verdict == "PASS"
    evidence.edit_table(
        ladder, "measure_baselines/modes.parquet",
        lambda f: f.assign(**{
            key: np.where(f["method"] == name, 16, f[key]) for key in ("admissible", "valid")
        }),
    )  # fmt: skip
    report = judge(ladder, "A")
    criterion = found(ladder, "remedy_valid_share")
    assert report.verdict == "FAIL" and criterion.verdict == "FAIL"
    assert criterion.measured == 1.0 and f"{name} 100 %" in criterion.caveat
    assert criterion.caveat.startswith("share of 30 situations in which the first ")


@pytest.mark.parametrize("name", list(evidence.REMEDIES))
def test_a_remedy_that_was_not_tried_leaves_no_verdict(ladder, name):
    evidence.edit_table(ladder, "measure_baselines/modes.parquet", lambda f: f[f["method"] != name])
    assert found(ladder, "remedy_valid_share").verdict == "INCONCLUSIVE"
    evidence.write_params(ladder, lambda p: p["train_baselines"]["samplers"].pop(name))
    criterion = found(ladder, "remedy_valid_share")
    assert criterion.verdict == "INCONCLUSIVE" and f"not trained: {name}" in criterion.caveat


def test_in_doubt_a_remedy_is_taken_to_be_valid_more_often(ladder):
    """A chance of 0.364 in 30 episodes is 10.9 of them: 11, for what is judged is how high."""

    def sampled(frame):
        rows = frame["method"] == "bc_noise"
        return frame.assign(**{k: np.where(rows, v, frame[k]) for k, v in SAMPLED.items()})

    evidence.edit_table(ladder, "measure_baselines/modes.parquet", sampled)
    criterion = found(ladder, "remedy_valid_share")
    assert criterion.interval == pytest.approx(clopper_pearson(11, 30, 0.975))


def test_the_level_is_divided_among_as_many_as_could_look_valid(ladder):
    """Two remedies and two conditioning variants, none valid in 30 situations of 30 episodes."""
    for name in ("remedy_valid_share", "factor_valid_share"):
        criterion = found(ladder, name)
        assert criterion.interval == pytest.approx(clopper_pearson(0, 30, 0.975)), name
        assert criterion.measured == criterion.interval[1]


def test_a_test_that_does_not_reject_shows_no_style(ladder):
    """Not rejecting is no proof: only a change that is the same everywhere is held against it."""
    path = "measure_baselines/latent.json"
    for exceeding, verdict in ((0, "PASS"), (30, "PASS"), (60, "INCONCLUSIVE"),
                               (998, "INCONCLUSIVE")):  # fmt: skip
        evidence.edit_document(ladder, path, lambda d, n=exceeding: [{**d[0], "exceeding": n}])
        assert found(ladder, "latent_dependence_p").verdict == verdict, exceeding
    assert "neither a strategy nor a style" in found(ladder, "latent_dependence_p").caveat
    style = {"condition_share": 0.9e-8, "distance_correlation": 0.0, "exceeding": 999}
    evidence.edit_document(
        ladder, path, lambda d: [{**d[0], "exceeding": 300}, {**d[0], **style, "seed": 1}]
    )
    criterion = found(ladder, "latent_dependence_p")
    assert criterion.verdict == "FAIL" and criterion.measured == 1.0
    still = {**style, "condition_share": 0.4, "spread_m": 0.9e-6}
    evidence.edit_document(ladder, path, lambda d: [{**d[0], **still}])
    assert found(ladder, "latent_dependence_p").verdict == "FAIL"
    # A p that rejects does not cover one that does not, in whichever row it stands.
    rejects = {"condition_share": 0.0, "exceeding": 0}
    open_ = {"condition_share": 0.4, "spread_m": 0.03, "exceeding": 300}
    evidence.edit_document(
        ladder, path, lambda d: [{**d[0], **rejects}, {**d[0], **open_, "seed": 1}]
    )
    assert found(ladder, "latent_dependence_p").verdict == "INCONCLUSIVE"


def test_of_several_tests_of_a_latent_the_one_with_the_highest_upper_end_decides(ladder):
    """20 of 999 prove less than 2,500 of 99,999, whose share and lower end are the higher ones."""
    path = "measure_baselines/latent.json"
    few = {"exceeding": 20, "permutations": 999, "seed": 0}
    many = {"exceeding": 2500, "permutations": 99999, "seed": 1}
    for order in ((few, many), (many, few)):
        evidence.edit_document(ladder, path, lambda d, o=order: [{**d[0], **row} for row in o])
        assert found(ladder, "latent_dependence_p").interval[1] == pytest.approx(
            clopper_pearson(20, 999)[1], abs=1e-6
        )


def test_a_situation_with_one_mode_asks_no_simple_policy(ladder):
    """Ten of thirty have one mode, and there every sample is valid and every mode is covered."""

    def change(frame):
        easy = {"modes_present": 1, "modes_covered": 1, "modes_valid": 1, "samples": 16,
                "admissible": 16, "valid": 16}  # fmt: skip
        places = sorted(set(zip(frame["episode_uuid"], frame["index"], strict=True)))[:10]
        of = [at in places for at in zip(frame["episode_uuid"], frame["index"], strict=True)]
        return frame.assign(**{name: np.where(of, v, frame[name]) for name, v in easy.items()})

    evidence.edit_table(ladder, "measure_baselines/modes.parquet", change)
    for name in ("remedy_valid_share", "chunking_valid_share"):
        criterion = found(ladder, name)
        assert criterion.recount.whole == 20 and criterion.interval[0] == 0.0
