"""Planted causes on the planar task: each must be named, and none for another's reason."""

import pytest
from planar import SETTINGS, audited, limits_with, named, planar

from gates.cause import CauseName
from genpolicy.audit.run import audit


def test_valid_modes_are_found(valid):
    assert named(valid).name is CauseName.VALID_MODES
    assert valid.counts.two_mode_episodes >= 30
    assert valid.counts.persistent >= 0.95 * valid.counts.two_mode
    assert valid.persistence.observed - valid.persistence.null_q95 > 0.3
    assert len(valid.modes) == 2
    assert min(mode.success_lower for mode in valid.modes) > 0.85


def test_a_hidden_operator_is_named():
    verdict = named(audited(modes="operator"))
    assert (verdict.name, verdict.variable) == (CauseName.HIDDEN_STATE, "operator")
    assert "operator explains" in verdict.next_action


def test_modes_of_an_epoch_are_a_data_defect():
    verdict = named(audited(modes="epoch"))
    assert (verdict.name, verdict.variable) == (CauseName.DATA_DEFECT, "calibration_epoch")


def test_what_the_policy_sees_is_no_hidden_state():
    # The goal's side decides, by less than the scale that makes another observation.
    verdict = named(audited(modes="goal", episodes=200))
    assert (verdict.name, verdict.kind) == (CauseName.UNIMODAL, "observed_variable")
    assert verdict.variable == "goal.y_m"


def test_one_side_only_is_unimodal():
    result = audited(modes="none")
    assert named(result).name is CauseName.UNIMODAL
    assert result.counts.two_mode == 0


def test_tremor_is_not_a_mode():
    limits = limits_with(supported_episodes=15, calibration_residual_m=0.03)
    verdict = named(audited(modes="none", tremor_m=0.02), limits=limits)
    assert verdict.name is CauseName.POINTWISE_NOISE


@pytest.mark.parametrize("modes", ["free", "none"])
def test_a_clock_offset_is_named_before_its_modes(modes):
    result = audited(modes=modes, clock_steps=3)
    verdict = named(result)
    assert (verdict.name, verdict.kind) == (CauseName.DATA_DEFECT, "clock")
    offsets = {clock.epoch: clock.offset_before_s for clock in result.semantics.clocks}
    assert abs(offsets["epoch_2"] - offsets["epoch_1"]) == pytest.approx(0.3, abs=0.02)
    assert all(abs(clock.offset_after_s) < 0.02 for clock in result.semantics.clocks)


def test_false_modes_of_a_clock_offset_vanish_after_realignment():
    result = audited(modes="none", clock_steps=6, settings=SETTINGS.model_copy(
        update={"representation": "time"}))  # fmt: skip
    assert result.counts.two_mode_episodes > 10
    assert result.modes_after_realignment <= result.counts.two_mode_episodes / 4


def test_a_shifted_calibration_is_a_data_defect():
    verdict = named(audited(epoch_shift_m=0.01))
    assert (verdict.name, verdict.kind) == (CauseName.DATA_DEFECT, "calibration")


def test_wrong_labels_are_contamination():
    verdict = named(audited(wrong_labels=0.2))
    assert verdict.name is CauseName.LABEL_CONTAMINATION


def test_a_mode_that_fails_honestly_leaves_one():
    verdict = named(audited(side_fails=True))
    assert (verdict.name, verdict.kind) == (CauseName.UNIMODAL, "one_valid_mode")


def test_an_infeasible_mode_leaves_one():
    verdict = named(audited(check=lambda a, o: (a[:, 1].min() > -0.03, "collision")))
    assert (verdict.name, verdict.kind) == (CauseName.UNIMODAL, "one_valid_mode")


def test_few_data_support_nothing():
    limits = limits_with(label_disagreement=0.5)
    verdict = named(audited(episodes=20), limits=limits)
    assert (verdict.name, verdict.kind) == (CauseName.INSUFFICIENT_SUPPORT, "neighbourhoods")
    assert named(audited(episodes=20)).kind == "replay"


def test_without_outcomes_no_mode_is_valid():
    from dataclasses import replace

    data, _ = planar()
    data = replace(data, episodes=replace(data.episodes, outcome=data.episodes.split.astype("<U1")))
    data.episodes.outcome[:] = ""
    verdict = named(audit(data, SETTINGS, admissible=None, replay=None, root_seed=3))
    assert (verdict.name, verdict.kind) == (CauseName.INSUFFICIENT_SUPPORT, "not_recorded")
