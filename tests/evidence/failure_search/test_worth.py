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
    assert of(False) == 0.0 and of(True, duration_s=12.5) == 0.0, "never below a failure"
