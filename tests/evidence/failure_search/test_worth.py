"""Every failure is worth less than every success; mild failures are worth least."""

import pytest

from genpolicy.evidence.failure_search.worth import worth


def of(success, *, duration_s=6.0, force_peak_n=0.0, share=1.0):
    rollout = {"success": success, "duration_s": duration_s, "force_peak_n": force_peak_n}
    return worth(rollout, share=share, episode_limit_s=12.0, force_limit_n=40.0)


def test_a_success_is_worth_what_it_had_left():
    assert of(True) == pytest.approx(0.5)
    assert of(True, duration_s=9.0) == pytest.approx(0.25)
    assert of(True, force_peak_n=36.0) == pytest.approx(0.1)
    assert of(True, force_peak_n=36.0, share=0.01) == of(True, force_peak_n=36.0)


def test_failures_lie_below_and_the_milder_is_lower():
    assert of(False, share=0.1) < of(False, share=0.9) < of(True, duration_s=11.9)
    assert of(False) == 0.0


@pytest.mark.parametrize("ended", [{"duration_s": 12.0}, {"force_peak_n": 40.0},
                                   {"duration_s": 12.5}])  # fmt: skip
def test_a_success_with_nothing_left_lies_above_every_failure(ended):
    """At the time limit, or where a condition has no size, so that every failure is of full size.

    The search only orders: what is equal is a failure as good as a success.
    """
    assert of(False, share=1.0) < of(True, **ended) < of(True, duration_s=11.95)
