"""The table of floors and ceilings: where each lies, whose it is, and what a task may lack."""

import pytest
from asked import settings_of

from gates.criterion import Criterion
from gates.floors import BOUNDS, OLDEST_ACTION_S
from gates.preregistration import by_criterion
from gates.proof import SPECS
from gates.protection import SHARED
from gates.report import GATES
from gates.stress.cost import latency_p95_s
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.integrity.documents import read_yaml

# Where each bound lies, as it was decided. Moving one is a decision of its own: the reason for it
# stands beside it in the code, that of the numbers from elsewhere here (ISO 10218-1: 0.25 m/s).
EXECUTED = {
    "execution.watchdog_s": 0.1, "execution.force_limit_n": 80, "execution.maximum_age_s": 1,
    "execution.deadline_s": 1, "execution.maximum_divergence_m": 0.2,
    "execution.maximum_scene_shift_m": 0.05,
    "feasibility.position_change_limit_m": 0.1,
}  # fmt: skip
CAUSE = {
    "clock_disorder": 0, "swapped_columns": 0, "rate_deviation": 0.5, "frozen_s": 2,
    "gap_share": 0.1, "jitter_share": 1, "gain_factor": 10, "gain_epoch_factor": 1.5,
    "magnitude_factor": 10, "frame_angle_rad": 0.5, "faulty_episodes_share": 0.1,
    "lag_drift_rows": 5, "supported_episodes": 5, "supported_share": 0.05, "denial_share": 0.2,
}  # fmt: skip
GOLDEN = {
    "A": {"data_defects": 0, "refused_recordings_accounted": 0, "baselines_matched": 0,
          "cause_accepted": 1, "told_share": 0.7, "remedy_valid_share": 0.9, "unasked_checks": 0,
          "factors_isolated": 0, "mode_feasible_share": 0.5, "mode_success_lower": 0.3,
          "mean_defeated_share": 0.3, "multimodal_situations": 10, "held_out_situations": 20,
          "persistence_margin": 0.02, "chunking_valid_share": 0.9, "factor_valid_share": 0.9,
          "baseline_mode_coverage": 0.95, "clock_residual_s": 0.05,
          "calibration_residual_m": 0.02, "lag_spread_rows": 2, "label_disagreement": 0.3,
          "strata_effect": 0.7, "phase_collapse_share": 0.8, "latent_dependence_p": 0.2,
          **{f"gate_a.cause.{name}": bound for name, bound in CAUSE.items()}},
    "B": {"unpinned_items": 0, "metadata_mismatches": 0, "nfe_mismatch": 0,
          "nonfinite_weights": 0, "conformance": 0, "policy.fixtures": 8,
          "parameter_budget_deviation": 0.25, "samples_difference": 1e-5,
          "varied_difference": 1e-4,
          "unmatched_keys": 0, "latency_terms_missing": 0, "gate_b.mode_minimum_share": 0.05,
          "mode_coverage_lower": 0.25, "outside_modes_upper": 0.4, "late_change_upper": 0.2,
          "baseline_fall_upper": 0.25, "warm_latency_ratio_upper": 3, "cold_latency_ratio_upper": 5,
          "latency_model_ratio_upper": 2},
    "C": {**EXECUTED, "gate_c.mode_observations": 30, "stub_stale": 0,
          "stub_invalid": 0, "checker_violations": 0, "mutants_undetected": 0,
          "conservation_error": 0, "incidents_miscounted": 0, "changed_answers": 0,
          "corrupted_refused_share": 1, "stub_violation_upper": 0.01,
          "mode_admissible_gap": 0.5, "admissible_share": 0.1, "projection_p95_m": 0.1,
          "boundary_jerk_p95_m_s3": 20000},
    "D": {"stub_violations": 0, "checker_violations": 0, "conservation_error": 0,
          "unmatched_starts": 0, "changed_answers": 0, **EXECUTED, "deadline_miss_upper": 0.5,
          "hold_share_upper": 0.5, "fallback_share_upper": 0.5, "stress_success_lower": 0.05,
          "nominal_success_lower": 0.2, "recovery_success_lower": 0.2, "latency_p95_s": 1,
          "rejection_share_upper": 0.5, "force_peak_p95_n": 80, "intervention_upper": 0.2,
          "reset_upper": 0.1, "verdict_reachable": 0.8, "stress.starts": 59,
          "stress.alpha": 0.1, "stress.planned_effect": 0.5, "stress.margin": 0,
          "stress.perturbations.envelope.speed_limit_m_s": 0.25},
    "E": {"gate_e.maximum_days": 30, "upstream_passed": 1, "draft_complete": 0,
          "signature_valid": 1, "reviewer_independent": 1, "owners_signed": 4,
          "envelope_within_limits": 0, "not_expired": 1},
}  # fmt: skip


NOT_WRITTEN = {
    "execution.maximum_scene_shift_m":
        ExecutionSettings.model_fields["maximum_scene_shift_m"].default,
}  # fmt: skip


def test_golden_where_each_bound_lies():
    found = {gate: {b.place: b.bound for b in BOUNDS if b.gate == gate} for gate in GATES}
    intervals = {gate: found[gate].pop("confidence") for gate in "ABCD"}
    assert intervals == dict.fromkeys("ABCD", 0.9), "every gate that draws an interval"
    assert found == GOLDEN
    assert len(BOUNDS) == sum(map(len, GOLDEN.values())) + len(intervals)
    waivable = [bound.place for bound in BOUNDS if bound.waivable]
    assert waivable == [
        "clock_residual_s", "calibration_residual_m", "lag_spread_rows", "label_disagreement",
        "strata_effect", "phase_collapse_share", "latent_dependence_p",
        "force_peak_p95_n", "recovery_success_lower",
    ]  # fmt: skip
    assert [bound.place for bound in BOUNDS if bound.of] == ["stress.planned_effect"]
    assert [bound.place for bound in BOUNDS if bound.derives] == ["latency_p95_s"]


def test_every_bound_is_of_a_criterion_or_a_setting(request):
    params = read_yaml(request.config.rootpath / "params.yaml")
    for bound in BOUNDS:
        if "." in bound.place or bound.place in SHARED:
            value = params
            *sections, name = bound.place.split(".")
            for part in sections:
                value = value[part]
            value = by_criterion(value) if sections[-1:] == ["cause"] else value
            if bound.place in NOT_WRITTEN:  # what the code assumes keeps to its bound
                assert name not in value and NOT_WRITTEN[bound.place] <= bound.bound
            else:
                assert name in value
            continue
        criterion = {item.id: item for item in SPECS[bound.gate].criteria}[bound.place]
        assert isinstance(criterion, Criterion) and criterion.comparison == bound.comparison


def _may_lack(place, **params):
    (bound,) = [bound for bound in BOUNDS if bound.place == place]
    return bound.waivable(params)


def _conditions(**entries):
    return {"perturbations": entries}


def test_who_drills_or_plans_a_recovery_does_not_lack_one():
    lacks = lambda **params: _may_lack("recovery_success_lower", **params)  # noqa: E731
    nowhere = {"recovery_plans": {"default": [], "approach": []}}
    assert lacks() and lacks(stress=_conditions(nominal={}), execution=nowhere)
    assert not lacks(stress=_conditions(recovery_drill={}), execution=nowhere)
    assert not lacks(stress=_conditions(recovery_drill=None))
    assert not lacks(stress=_conditions(called={"kind": "recovery_drill"}))
    # The kind is what counts; the settings of the stage refuse this name of another kind.
    assert lacks(stress=_conditions(recovery_drill={"kind": "nominal"}))
    plans = {"default": [], "approach": ["retreat"]}
    assert not lacks(stress=_conditions(nominal={}), execution={"recovery_plans": plans})
    assert not lacks(execution={"recovery_plans": ["retreat"]})
    assert lacks(stress=["nominal"], execution="none")  # of another form: refused elsewhere


def test_who_pushes_in_contact_does_not_touch_nothing():
    lacks = lambda **params: _may_lack("force_peak_p95_n", **params)  # noqa: E731
    assert lacks() and lacks(stress=_conditions(nominal={}, push={"force_n": 15.0}))
    assert lacks(stress=_conditions(push={"force_n": 15.0, "contact_force_n": 0.0}))
    assert not lacks(stress=_conditions(push={"force_n": 15.0, "contact_force_n": 30.0}))
    assert not lacks(stress=_conditions(aside={"kind": "push", "contact_force_n": 1.0}))


def test_the_shipped_ladder_exercises_both(request):
    params = read_yaml(request.config.rootpath / "params.yaml")
    drilled = [bound for bound in BOUNDS if bound.waivable and bound.gate == "D"]
    assert len(drilled) == 2 and not any(bound.waivable(params) for bound in drilled)


@pytest.mark.parametrize(
    ("horizon", "oldest_s", "limit_s"),
    [(8, 0.45, 0.4), (20, 0.45, 0.45), (180, 0.45, 0.45), (180, 9.0, OLDEST_ACTION_S)],
)
def test_a_limit_that_follows_from_settings_is_held_to_its_bound(
    ladder, horizon, oldest_s, limit_s
):
    """With an execution horizon of 180 actions of .05 s an answer after 9 s was in time."""
    settings = settings_of(ladder, "D").model_copy(
        update={"execution_horizon": horizon, "maximum_age_s": oldest_s}
    )
    assert latency_p95_s.derived(settings) == pytest.approx(limit_s)
