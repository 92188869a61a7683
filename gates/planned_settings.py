"""Which settings of `params.yaml` a plan names, on which side each is strict, who judges by them.

All of them are named but those of `tests/gates/test_planned_settings.py`, which says why: the plan
is of little worth if what it leaves out can make other evidence.
"""

from collections.abc import Mapping
from typing import NamedTuple

from gates.may_differ import PLACE
from gates.report import Gate

UNMATCHED = "gate_b.unmatched"
"""Written exceptions from the matching of who was brought, by candidate."""
OPEN = (PLACE, UNMATCHED)
"""Places where an entry more asks less."""


class Planned(NamedTuple):
    """A setting of the plan beside limits.

    Attributes:
        strict: On which side it is strict, `<=` or `>=`; '' where neither is.
        gate: The lowest gate that judges by it, or whose evidence is made with it.
    """

    strict: str
    gate: Gate


PLANNED: Mapping[str, Planned] = {
    "seed": Planned("", "A"),
    "record.episodes": Planned(">=", "A"),
    "record.shares": Planned("", "A"),
    "ingest.train": Planned("", "A"),
    "ingest.validation": Planned("", "A"),
    "policy.seeds": Planned("", "A"),
    "policy.network": Planned("", "A"),
    "policy.training.updates": Planned("", "A"),
    "policy.training.batch_size": Planned("", "A"),
    PLACE: Planned("", "A"),
    "train_generators.samplers": Planned("", "B"),
    "candidates": Planned("", "B"),
    "confidence": Planned(">=", "A"),
    "gate_a.held_out_splits": Planned("", "A"),
    "gate_a.deployed_conventions": Planned("", "A"),
    "gate_a.generative_baselines": Planned("", "A"),
    "gate_a.chunked_baseline": Planned("", "A"),
    "gate_a.remedies": Planned("", "A"),
    "gate_a.one_mode": Planned("", "A"),
    "gate_a.conditioning_factors": Planned("", "A"),
    "policy.fixtures": Planned(">=", "B"),
    "latency.warm": Planned(">=", "B"),
    "latency.cold": Planned(">=", "B"),
    "latency.declared": Planned("", "B"),
    "reload.samples": Planned(">=", "B"),
    "gate_b.budget_reference": Planned("", "B"),
    "gate_b.mode_minimum_share": Planned(">=", "B"),
    UNMATCHED: Planned("", "B"),
    "gate_c.required_fixtures": Planned("", "C"),
    "gate_c.mode_observations": Planned(">=", "C"),
    "shadow.observations": Planned(">=", "C"),
    "stress.starts": Planned(">=", "D"),
    "stress.margin": Planned(">=", "D"),
    "stress.alpha": Planned("<=", "D"),
    "stress.planned_effect": Planned("", "D"),
    "stress.baselines": Planned("", "B"),
    "stress.perturbations": Planned("", "D"),
    "stress.episode_limit_s": Planned("", "D"),
    "stress.samples": Planned("", "A"),
    "stress.joining": Planned("", "B"),
    "stress.person": Planned("", "D"),
    "gate_d.tolerances": Planned("", "D"),
    "gate_e.maximum_days": Planned("<=", "E"),
}
"""What the plan names beside limits."""
IF_STATED: Mapping[str, Planned] = {
    "gate_a.factors": Planned("", "A"),
    "gate_a.waived_checks": Planned("", "A"),
    "gate_d.utility": Planned("", "D"),
    "compute.device": Planned("", "A"),
    "card.failure_search": Planned("", "D"),
}
"""What it names only where it is stated; older plans ask every factor and compare success."""
STATED: Mapping[str, Planned] = {**PLANNED, **IF_STATED}
SECTIONS: Mapping[str, Gate] = {
    "rehearsal": "A",
    "task": "A",
    "source": "A",
    "record": "A",
    "ingest": "A",
    "policy": "A",
    "horizons": "A",
    "feasibility": "A",
    "audit": "A",
    "train_baselines": "A",
    "measure_baselines": "A",
    "train_factors": "A",
    "measure_factors": "A",
    "train_generators": "B",
    "reload": "B",
    "latency": "B",
    "execution": "C",
    "shadow": "C",
    "stress": "D",
    "wall_clock": "D",
    "monitors": "D",
}
"""Sections of which the plan names every setting, and the lowest gate whose evidence reads them.
What stands above by itself, or within what does, is named there alone."""
SECTIONS_STRICT: Mapping[str, str] = {
    **dict.fromkeys(
        (
            "feasibility.position_change_limit_m", "execution.deadline_s", "execution.watchdog_s",
            "execution.maximum_age_s", "execution.maximum_divergence_m",
            "execution.maximum_scene_shift_m", "execution.force_limit_n",
        ), "<=",
    ),
    **dict.fromkeys(
        (
            "measure_baselines.samples", "measure_factors.samples", "wall_clock.episodes",
            "monitors.threshold_starts", "monitors.judged_starts", "monitors.probe_starts",
        ), ">=",
    ),
}  # fmt: skip
"""On which side their settings are strict, those of each phase alike; others on neither."""
CAUSE, COSTS = "cause", "monitor_costs"
"""Parts of a gate's section whose numbers stand below their owners, as its limits do."""
CAUSE_STRICT: Mapping[str, str] = {
    **dict.fromkeys(
        (
            "clock_disorder", "rate_deviation", "gap_share", "frozen_s", "jitter_share",
            "lag_drift_rows", "gain_factor", "gain_epoch_factor", "magnitude_factor",
            "frame_angle_rad", "swapped_columns", "faulty_episodes_share",
        ),
        "<=",
    ),
    **dict.fromkeys(("supported_episodes", "supported_share", "denial_share"), ">="),
}  # fmt: skip
"""On which side a limit of the cause is strict; of those left out, each side accepts something."""
AT_LEAST = frozenset(
    (
        "held_out_situations", "multimodal_situations", "persistence_margin", "mode_success_lower",
        "mode_feasible_share", "mean_defeated_share", "cause_accepted", "mode_coverage_lower",
        "admissible_share", "corrupted_refused_share", "verdict_reachable",
        "nominal_success_lower", "stress_success_lower", "recovery_success_lower",
        "promotion_e_value", "upstream_passed", "signature_valid", "reviewer_independent",
        "owners_signed", "not_expired",
    )
)  # fmt: skip
"""Criteria that may not be lower than their limit, all others not higher; who edits the plan
would edit what counts as looser, were it read from there."""
