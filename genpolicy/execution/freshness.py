"""May this chunk be used now? One ordered list of questions; the first no is the reason.

Whoever asks brings the situation along: what has been observed, which weights are active, when
something last voided everything conditioned before it.
"""

from dataclasses import dataclass, field

from genpolicy.contract.chunk import ChunkMetadata, DiscardReason
from genpolicy.execution.ledger import ChunkTimes

NEVER_NS = -(1 << 62)

VOIDING_CHECKS = {
    DiscardReason.PHASE_TRANSITION: "phase_transition",
    DiscardReason.CALIBRATION_MISMATCH: "calibration_mismatch",
    DiscardReason.FORCE_EVENT: "force_event",
    DiscardReason.COLLISION_EVENT: "collision_event",
    DiscardReason.OBSERVATION_DIVERGENCE: "observation_divergence",
    DiscardReason.INTERVENTION: "intervention",
    DiscardReason.STOPPED: "stopped",
    DiscardReason.RESET: "session_epoch",
}
"""Events that void every chunk conditioned on an earlier observation, and the check's name."""


@dataclass(slots=True)
class Situation:
    """What the executor knows about the present.

    Attributes:
        phase: Task phase of the newest observation; empty before the first.
        calibration_epoch: Calibration of the newest observation.
        newest_observation_ns: Event time of the newest observation; None before the first.
        checkpoint: Active weights of the policy.
        sampler: Active sampler settings.
        session_epoch: Number of resets.
        void_before_ns: Per reason, chunks conditioned before this time are void.
    """

    phase: str = ""
    calibration_epoch: str = ""
    newest_observation_ns: int | None = None
    checkpoint: str = ""
    sampler: str = ""
    session_epoch: int = 0
    void_before_ns: dict[DiscardReason, int] = field(default_factory=dict)

    def void(self, reason: DiscardReason, time_ns: int) -> None:
        """Void what was conditioned before `time_ns`."""
        self.void_before_ns[reason] = max(time_ns, self.void_before_ns.get(reason, NEVER_NS))


def identity_refusal(
    metadata: ChunkMetadata,
    situation: Situation,
    *,
    checkpoint: str,
    sampler: str,
    disabled: frozenset[str],
) -> DiscardReason | None:
    """Wrong session, weights, sampler, calibration or phase."""
    questions = (
        ("session_epoch", metadata.session_epoch == situation.session_epoch, DiscardReason.RESET),
        ("checkpoint_mismatch", metadata.policy_checkpoint_hash == checkpoint,
         DiscardReason.CHECKPOINT_MISMATCH),
        ("sampler_mismatch", metadata.sampler_config_hash == sampler,
         DiscardReason.SAMPLER_MISMATCH),
        ("calibration_mismatch", metadata.calibration_epoch == situation.calibration_epoch,
         DiscardReason.CALIBRATION_MISMATCH),
        ("phase_transition", metadata.task_phase == situation.phase,
         DiscardReason.PHASE_TRANSITION),
    )  # fmt: skip
    for check, holds, reason in questions:
        if not holds and check not in disabled:
            return reason
    return None


def time_refusal(
    times: ChunkTimes,
    situation: Situation,
    *,
    now_ns: int,
    first_use_ns: int,
    maximum_age_ns: dict[str, int],
    disabled: frozenset[str],
) -> DiscardReason | None:
    """From the future, too old, voided by an event, or past its validity.

    Age and validity are asked for the moment of first use: a chunk that will be too old when its
    first action is due is too old now.
    """
    newest_ns = situation.newest_observation_ns
    observed = newest_ns is not None and newest_ns - times.condition_ns >= 0
    age_ns = first_use_ns - times.condition_ns
    limit_ns = maximum_age_ns.get(situation.phase, -1)
    if not (observed and now_ns - times.condition_ns >= 0) and "future_observation" not in disabled:
        return DiscardReason.FUTURE_OBSERVATION
    if not limit_ns - age_ns >= 0 and "stale_observation" not in disabled:
        return DiscardReason.STALE_OBSERVATION
    for reason, check in VOIDING_CHECKS.items():
        time_ns = situation.void_before_ns.get(reason, NEVER_NS)
        if not times.condition_ns - time_ns >= 0 and check not in disabled:
            return reason
    if not times.valid_until_ns - first_use_ns >= 0 and "expired" not in disabled:
        return DiscardReason.EXPIRED
    return None
