"""What claims to be an admitted chunk is looked at here before anything else is asked."""

import numpy as np

from genpolicy.contract.action import ACTION_DIM
from genpolicy.contract.chunk import ChunkMetadata, DiscardReason, actions_sha256
from genpolicy.errors import GenpolicyError, IntegrityError
from genpolicy.execution.command import Mode
from genpolicy.execution.freshness import Situation, identity_refusal, time_refusal
from genpolicy.execution.ledger import FALLBACK, ChunkTimes
from genpolicy.execution.settings import LAYER_COUNT, ExecutorSettings
from genpolicy.feasibility.admission import Admitted

MALFORMED = "<malformed>"


def issued_by_feasibility(chunk: object) -> bool:
    """Whether the feasibility module made this very object, and its actions are unchanged."""
    if type(chunk) is not Admitted:
        return False
    try:
        chunk.verify()
    except IntegrityError:
        return False
    return True


def shape_of(admitted: Admitted) -> tuple[int, str]:
    """Number of rows and name of whatever was delivered, malformed things included."""
    actions = getattr(admitted, "actions", None)
    metadata = getattr(admitted, "metadata", None)
    rows = len(actions) if isinstance(actions, np.ndarray) and actions.ndim == 2 else 0
    return rows, metadata.chunk_id if isinstance(metadata, ChunkMetadata) else MALFORMED


def is_whole(admitted: Admitted, *, period_ns: int, disabled: frozenset[str]) -> bool:
    """Shape, finiteness, times, period, verdict and hash of what claims to be admitted."""
    try:
        times = ChunkTimes.of(admitted.metadata)
        actions, layers = admitted.actions, admitted.verdict.layers
        shaped = actions.ndim == 2 and actions.shape[1] == ACTION_DIM and len(actions) > 0
        passed = len(layers) == LAYER_COUNT and all(layer.passed is True for layer in layers)
        first, last = admitted.verdict.rows
        checked = 0 <= first < last <= len(actions)
        hashed = actions_sha256(actions) == admitted.actions_sha256
    except (AttributeError, TypeError, ValueError, GenpolicyError):
        return False
    return (
        shaped
        and times.period_ns == period_ns
        and checked
        and ((passed and bool(np.isfinite(actions).all())) or "infeasible" in disabled)
        and (hashed or "action_hash" in disabled)
    )


def standing_refusal(
    mode: Mode, source: str, *, known: bool, whole: bool, stopped: bool, disabled: frozenset[str]
) -> DiscardReason | None:
    """Refusals that need no clock: who commands, seen before, not what was admitted."""
    other = Mode.RUN if source == FALLBACK else Mode.FALLBACK
    questions = (
        ("end_of_episode", mode is Mode.ENDED, DiscardReason.END_OF_EPISODE),
        ("duplicate", known, DiscardReason.DUPLICATE),
        ("", not whole, DiscardReason.INFEASIBLE),
        ("intervention", mode is Mode.INTERVENTION, DiscardReason.INTERVENTION),
        ("stopped", mode is other or stopped, DiscardReason.STOPPED),
    )
    for check, faulty, reason in questions:
        if faulty and check not in disabled:
            return reason
    return None


def context_refusal(
    admitted: Admitted,
    situation: Situation,
    *,
    now_ns: int,
    source: str,
    settings: ExecutorSettings,
    disabled: frozenset[str],
) -> DiscardReason | None:
    """Refusals by what is true now: maker, phase, calibration, age, events, validity."""
    times, fallback = ChunkTimes.of(admitted.metadata), settings.fallback_hash
    reason = identity_refusal(
        admitted.metadata,
        situation,
        checkpoint=fallback if source == FALLBACK else situation.checkpoint,
        sampler=fallback if source == FALLBACK else situation.sampler,
        disabled=disabled,
    ) or time_refusal(
        times,
        situation,
        now_ns=now_ns,
        first_use_ns=max(now_ns, times.start_ns),
        maximum_age_ns=settings.maximum_age_ns,
        disabled=disabled,
    )
    usable = min(len(admitted.actions), settings.execution_horizon)
    past = now_ns - times.start_ns >= usable * times.period_ns
    if reason is None and past and not {"window", "execution_horizon"} & disabled:
        return DiscardReason.EXPIRED
    return reason
