"""The fresh layer: session, calibration, phase, weights, sampler, and time."""

from genpolicy.contract.chunk import ChunkMetadata
from genpolicy.feasibility.context import Context


def fresh(metadata: ChunkMetadata, context: Context) -> dict[str, float]:
    """Session, calibration, phase, weights, sampler, and time: is it meant for this moment?"""
    observed_s = metadata.condition_observation_event_time_s
    newest_s = context.newest_accepted_observation_s
    return {
        "reset": _equal(metadata.session_epoch, context.session_epoch),
        "calibration_mismatch": _equal(metadata.calibration_epoch, context.calibration_epoch),
        "phase_transition": _equal(metadata.task_phase, context.phase),
        "checkpoint_mismatch": _equal(
            metadata.policy_checkpoint_hash, context.active_checkpoint_hash
        ),
        "sampler_mismatch": _equal(metadata.sampler_config_hash, context.active_sampler_hash),
        "future_observation": min(
            context.now_s - observed_s, context.latest_observation_event_time_s - observed_s
        ),
        "out_of_order": float("inf") if newest_s is None else observed_s - newest_s,
        "stale_observation": context.maximum_age_s - (context.now_s - observed_s),
        "expired": metadata.valid_until_s - context.now_s,
    }


def _equal(first: object, second: object) -> float:
    return 0.0 if first == second else -1.0
