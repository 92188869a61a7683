"""Which rollouts are kept whole: the rule by hand, and that a shard keeps what it may ask for."""

from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.evidence.stress.worth import kept_whole, worth_watching


def row(condition="nominal", outcome="success", mode="left", duration_s=5.0, force=0.0):
    return SimpleNamespace(
        perturbation=condition, outcome=outcome, success=outcome == "success", mode=mode,
        duration_s=duration_s, force_peak_n=force,
    )  # fmt: skip


def test_the_rule_by_hand():
    """`left` succeeds twice under `push` and once under `nominal`: its median is of `push`."""
    rows = [
        row("nominal", duration_s=9.0),
        row("nominal", mode="right", duration_s=4.0, force=3.0),
        row("push", duration_s=7.0),
        row("push", duration_s=6.0),
        row("push", "timeout", duration_s=12.0),
        row("push", "force_stop", duration_s=2.0, force=50.0),
        row("push", "timeout", duration_s=11.0),
        row("push", "timeout", duration_s=13.0),
    ]
    assert worth_watching(rows) == {
        3: ["median success of mode left"],
        1: ["median success of mode right"],
        0: ["slowest success"],
        5: ["largest force", "force stop: median of 1"],
        4: ["timeout: median of 3"],
    }
    assert kept_whole(rows[:2]) == [True, True]
    assert kept_whole(rows[2:]) == [True] * 6  # of two successes the slowest, and the median


def test_what_touched_nothing_has_no_largest_force_and_nothing_is_asked_of_nothing():
    assert worth_watching([row(duration_s=5.0), row(duration_s=6.0), row(duration_s=7.0)]) == {
        1: ["median success of mode left"], 2: ["slowest success"],
    }  # fmt: skip
    assert worth_watching([]) == {}


@pytest.mark.parametrize("seed", range(20))
def test_whatever_is_worth_a_look_over_all_conditions_its_shard_keeps(seed):
    """Ties and all: durations and forces are drawn from few values."""
    rng = np.random.default_rng(seed)
    conditions = [f"c{n}" for n in range(4)]
    rows = [
        row(
            condition, str(rng.choice(["success", "success", "timeout", "collision"])),
            str(rng.choice(["left", "right"])), float(rng.integers(1, 6)),
            float(rng.integers(0, 3)),
        )
        for condition in conditions for _ in range(12)
    ]  # fmt: skip
    kept = [
        whole
        for condition in conditions
        for whole in kept_whole([one for one in rows if one.perturbation == condition])
    ]
    assert all(kept[place] for place in worth_watching(rows))
    assert all(kept[place] for place, one in enumerate(rows) if not one.success)
    assert not all(kept)  # it is a choice
    successes = sum(kept) - sum(not one.success for one in rows)
    assert successes <= len(conditions) * (2 + 2)
