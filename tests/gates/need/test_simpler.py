"""The simpler explanations: golden values, what counts as valid, what is reported only."""

import evidence
import numpy as np
import pandas as pd
import pytest

from gates.evidence import MissingEvidenceError
from gates.need.simpler import valid_share
from gates.proof import judge
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


@pytest.mark.parametrize(
    ("changes", "share"),
    [
        ({}, 1.0), ({"admissible": 3}, 0.0), ({"modes_covered": 0}, 0.0),
        ({"modes_covered": 2}, 1.0),
    ],
)  # fmt: skip
def test_valid_is_a_reached_mode_and_every_sample_admissible(changes, share):
    value, lower, upper, count = valid_share(rows(**changes), confidence=0.95)
    assert (value, count) == (share, 10)
    assert (lower, upper) == clopper_pearson(int(10 * share), 10, 0.95)


def test_valid_share_counts_episodes_and_only_situations_with_two_modes():
    frame = pd.concat([rows(), rows(modes_present=1)])
    assert valid_share(frame, confidence=0.95)[3] == 10
    one = rows().assign(episode_uuid="same")
    assert valid_share(one, confidence=0.95)[1] == clopper_pearson(1, 1, 0.95)[0]
    with pytest.raises(MissingEvidenceError, match="two modes"):
        valid_share(rows(modes_present=1), confidence=0.95)


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
    assert criterion.verdict == "FAIL" and criterion.measured > 0.3
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


def test_ibc_is_reported_beside_the_deployed_baselines_and_not_judged(ladder):
    criterion = found(ladder, "baseline_mode_coverage")
    assert criterion.measured == 0.5 and criterion.verdict == "PASS"
    assert "ibc, derivative_free 1 (100% of samples admissible)" in criterion.caveat
    # A convention under which others are deployed does not make an energy deterministic.
    evidence.edit_table(
        ladder, "measure_baselines/modes.parquet", lambda f: f.assign(convention="direct")
    )
    assert found(ladder, "baseline_mode_coverage").measured == 0.5
    evidence.write_params(ladder, lambda p: p["gate_a"].update(generative_baselines=[]))
    assert found(ladder, "baseline_mode_coverage").measured == 1.0


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
