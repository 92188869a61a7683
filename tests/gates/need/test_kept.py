"""How many modes the best simple policy keeps: judged at the upper end, over episodes."""

import evidence
import numpy as np
import pandas as pd
import pytest

from gates.need.kept import coverage
from gates.proof import judge
from genpolicy.statistics.intervals import clopper_pearson

PATH = "measure_baselines/modes.parquet"
DEPLOYED = 6
"""Conventions of this evidence under which a baseline is deployed."""


def found(root):
    (criterion,) = [c for c in judge(root, "A").criteria if c.id == "baseline_mode_coverage"]
    return criterion


def scattered(frame, **changes):
    """Noise beside the mean, with other counts; of this evidence it reaches nothing."""
    rows = frame["method"] == "bc_noise"
    return frame.assign(**{k: np.where(rows, v, frame[k]) for k, v in changes.items()})


def interval(hits, episodes):
    return pytest.approx(clopper_pearson(hits, episodes, 1.0 - 0.05 / DEPLOYED))


def test_the_bound_is_over_episodes_and_the_level_is_divided_among_the_conventions(ladder):
    criterion = found(ladder)
    assert criterion.interval == interval(0, 30) and criterion.measured == criterion.interval[1]
    assert f"best of {DEPLOYED} deployed conventions" in criterion.caveat
    assert criterion.counted == "30 episodes" and criterion.verdict == "PASS"


def test_rows_of_one_episode_are_one():
    frame = pd.DataFrame(
        {"episode_uuid": list("abcd"), "modes_present": 2, "modes_valid": [1, 2] * 2}
    )
    once = coverage(frame, 0.95)
    assert once == (0.75, *clopper_pearson(3, 4))
    assert coverage(pd.concat([frame] * 5), 0.95) == once


@pytest.mark.parametrize(("modes", "verdict"), [(1, "INCONCLUSIVE"), (2, "FAIL")])
def test_one_of_two_modes_in_thirty_episodes_is_not_shown_to_be_below_three_fifths(
    ladder, modes, verdict
):
    """A half, of a limit of .6: the number alone would hold."""
    evidence.edit_table(ladder, PATH, lambda f: scattered(f, modes_valid=modes))
    criterion = found(ladder)
    assert criterion.verdict == verdict and "by bc_noise, offset" in criterion.caveat
    assert criterion.interval == interval(15 * modes, 30)


def test_noise_counts_only_by_what_may_be_executed(ladder):
    evidence.edit_table(ladder, PATH, lambda f: scattered(f, modes_covered=2))
    assert found(ladder).interval[0] == 0.0


def test_more_modes_than_there_are_is_no_evidence(ladder):
    evidence.edit_table(ladder, PATH, lambda f: scattered(f, modes_valid=3))
    criterion = found(ladder)
    assert criterion.verdict == "INCONCLUSIVE" and criterion.interval is None
    assert "more modes are reached than the situation has" in criterion.caveat


def test_a_situation_with_one_mode_is_not_asked(ladder):
    """Ten of thirty have one mode, and there every mode is covered."""

    def change(frame):
        easy = {"modes_present": 1, "modes_covered": 1, "modes_valid": 1}
        places = sorted(set(zip(frame["episode_uuid"], frame["index"], strict=True)))[:10]
        of = [at in places for at in zip(frame["episode_uuid"], frame["index"], strict=True)]
        return frame.assign(**{name: np.where(of, v, frame[name]) for name, v in easy.items()})

    evidence.edit_table(ladder, PATH, change)
    assert found(ladder).interval == interval(0, 20)


def test_ibc_is_reported_beside_the_deployed_baselines_and_not_judged(ladder):
    criterion = found(ladder)
    assert criterion.interval[0] == 0.0 and criterion.verdict == "PASS"
    assert "ibc, derivative_free 100 % (100 % of its samples admissible)" in criterion.caveat
    # A convention under which others are deployed does not make an energy deterministic.
    evidence.edit_table(ladder, PATH, lambda f: f.assign(convention="direct"))
    assert found(ladder).interval[0] == 0.0
    evidence.write_params(ladder, lambda p: p["gate_a"].update(generative_baselines=[]))
    assert found(ladder).measured == 1.0


def test_all_that_are_drawn_at_random_are_told_and_the_best_comes_first(ladder):
    """Each with its own coverage and its own share of what may be executed."""

    def drawn(frame):
        of = frame["method"] == "ibc"
        other = {"modes_valid": 1, "admissible": frame["samples"][of] // 4}
        more = [frame[of].assign(convention=name, **other) for name in ("langevin", "annealed")]
        return pd.concat([*more, frame], ignore_index=True)

    evidence.edit_table(ladder, PATH, drawn)
    assert found(ladder).caveat.endswith(
        "; drawn at random, as a generator: ibc, derivative_free 100 % (100 % of its samples "
        "admissible), ibc, langevin 50 % (25 % of its samples admissible), "
        "ibc, annealed 50 % (25 % of its samples admissible)"
    )
