"""The fresh layer: each of its checks alone."""

from dataclasses import replace

import pytest

NAMES = (
    "session_epoch", "calibration_mismatch", "phase_transition", "checkpoint_mismatch",
    "sampler_mismatch", "future_observation", "behind_accepted", "stale_observation", "expired",
)  # fmt: skip


@pytest.fixture(scope="module")
def cases(checker, kit):
    good, ctx = kit.line(kit.START, kit.SIDE), kit.context(checker, kit.START)
    later = replace(ctx, newest_accepted_observation_s=9.91)
    changes = {
        "session_epoch": {"session_epoch": 0},
        "calibration_mismatch": {"calibration_epoch": "e1"},
        "phase_transition": {"task_phase": "align"},
        "checkpoint_mismatch": {"policy_checkpoint_hash": "x"},
        "sampler_mismatch": {"sampler_config_hash": "x"},
        "future_observation": {"condition_observation_event_time_s": 9.96},
        "behind_accepted": {},
        "stale_observation": {"condition_observation_event_time_s": 9.69},
        "expired": {"valid_until_s": 9.999},
    }
    return {
        name: kit.Outside(good, later if name == "behind_accepted" else ctx, change)
        for name, change in changes.items()
    }


@pytest.mark.parametrize("name", NAMES)
def test_outside_is_refused_by_exactly_this_check(name, cases, build, kit):
    assert kit.names_of("fresh") == list(NAMES) == list(cases)
    kit.turns_red(build, name, cases[name])


def test_shrinking_validity_and_age_never_admits(checker, kit):
    """P8 for deadlines."""
    ctx, good = kit.context(checker, kit.START), kit.line(kit.START, kit.SIDE)
    ages = [kit.judge(checker, good, replace(ctx, maximum_age_s=a)).passed for a in (0.3, 0.1, 0)]
    until = [kit.judge(checker, good, ctx, valid_until_s=t).passed for t in (10.4, 10.0, 9.9)]
    assert ages == [True, True, False]
    assert until == [True, True, False]
