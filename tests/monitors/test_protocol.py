"""What a monitor learns from: the training windows and nothing that was held out."""

from dataclasses import fields

from genpolicy.monitors.protocol import NO_WEIGHTS, Fit


def test_a_fit_holds_training_windows_alone():
    assert [field.name for field in fields(Fit)] == [
        "windows", "normalisation", "action_period_s", "policy", "others", "candidates",
    ]  # fmt: skip
    assert "not known here" in NO_WEIGHTS.why
