"""Where each question of the table is asked, written down beside the table and not read from it.

A mutant that is made of the table's own places cannot miss one that is gone. So the pairs stand
here once more, each with the reason by which the place refuses, and a test holds both together: a
row or a place that is added to the table is missing here until somebody writes it down, and then
it needs a mutant (`place_mutants`), which Gate C asks for by name (`gates/asked_for.py`).
"""

from typing import NamedTuple

from genpolicy.contract.chunk import DiscardReason
from genpolicy.execution.checks import Place


class Asked(NamedTuple):
    """Where a row must be asked, and why it refuses.

    Attributes:
        reason: Reason for which what it refuses is discarded; None: nothing is, it holds.
        places: Where it must be asked.
    """

    reason: DiscardReason | None
    places: tuple[Place, ...]


_R, _P = DiscardReason, Place
_LIVE = (_P.ARRIVAL, _P.QUEUE, _P.STUB)
_JUDGED = (*_LIVE, _P.LAYER)

PLACES = {
    "end_of_episode": Asked(_R.END_OF_EPISODE, (_P.DOOR, _P.QUEUE, _P.STUB)),
    "issued": Asked(_R.INFEASIBLE, (_P.DOOR, _P.STUB)),
    "duplicate": Asked(_R.DUPLICATE, (_P.DOOR,)),
    "infeasible": Asked(_R.INFEASIBLE, (_P.ARRIVAL, _P.STUB)),
    "period": Asked(_R.INFEASIBLE, (_P.ARRIVAL, _P.STUB)),
    "action_hash": Asked(_R.INFEASIBLE, (_P.ARRIVAL, _P.STUB)),
    "same_action": Asked(_R.INFEASIBLE, (_P.STUB,)),
    "execution_horizon": Asked(_R.INFEASIBLE, (_P.ROWS, _P.STUB)),
    "checked_rows": Asked(_R.INFEASIBLE, (_P.ROWS, _P.STUB)),
    "intervention": Asked(_R.INTERVENTION, _LIVE),
    "stopped": Asked(_R.STOPPED, _LIVE),
    "commander": Asked(_R.STOPPED, _LIVE),
    "controller_mode": Asked(_R.STOPPED, _LIVE),
    "session_epoch": Asked(_R.RESET, _JUDGED),
    "checkpoint_mismatch": Asked(_R.CHECKPOINT_MISMATCH, _JUDGED),
    "sampler_mismatch": Asked(_R.SAMPLER_MISMATCH, _JUDGED),
    "calibration_mismatch": Asked(_R.CALIBRATION_MISMATCH, _JUDGED),
    "phase_transition": Asked(_R.PHASE_TRANSITION, _JUDGED),
    "future_observation": Asked(_R.FUTURE_OBSERVATION, _JUDGED),
    "stale_observation": Asked(_R.STALE_OBSERVATION, _JUDGED),
    "after_phase_transition": Asked(_R.PHASE_TRANSITION, _LIVE),
    "after_calibration_mismatch": Asked(_R.CALIBRATION_MISMATCH, _LIVE),
    "after_force_event": Asked(_R.FORCE_EVENT, _LIVE),
    "after_collision_event": Asked(_R.COLLISION_EVENT, _LIVE),
    "after_observation_divergence": Asked(_R.OBSERVATION_DIVERGENCE, _LIVE),
    "after_intervention": Asked(_R.INTERVENTION, _LIVE),
    "after_stop": Asked(_R.STOPPED, _LIVE),
    "after_reset": Asked(_R.RESET, _LIVE),
    "scene": Asked(_R.OBSERVATION_DIVERGENCE, _LIVE),
    "expired": Asked(_R.EXPIRED, _JUDGED),
    "early": Asked(_R.EXPIRED, (_P.DUE, _P.STUB)),
    "window": Asked(_R.EXPIRED, (_P.ARRIVAL, _P.PAST, _P.STUB)),
    "late_chunk": Asked(_R.EXPIRED, (_P.ARRIVAL, _P.STUB)),
    "behind_accepted": Asked(_R.SUPERSEDED, (_P.ARRIVAL, _P.LAYER)),
    "behind_queued": Asked(_R.OUT_OF_ORDER, (_P.ARRIVAL,)),
    "predecessor": Asked(_R.BROKEN_PREDECESSOR, (_P.ARRIVAL,)),
    "queue_overflow": Asked(_R.QUEUE_OVERFLOW, (_P.ROOM,)),
    "superseded": Asked(_R.SUPERSEDED, (_P.ROWS, _P.DUE)),
    "out_of_order": Asked(_R.OUT_OF_ORDER, (_P.DUE, _P.STUB)),
    "sequence": Asked(_R.OUT_OF_ORDER, (_P.STUB,)),
    "continuity": Asked(_R.BROKEN_PREDECESSOR, (_P.NEXT, _P.STUB)),
    "pace": Asked(_R.OUT_OF_ORDER, (_P.DUE, _P.STUB)),
    "divergence": Asked(_R.OBSERVATION_DIVERGENCE, (_P.OBSERVED,)),
    "watchdog": Asked(None, (_P.SUPERVISOR,)),
}
"""Each row of `genpolicy/execution/checks.py`, in its order."""

ELSEWHERE = {_P.LAYER: "fresh"}
"""Places whose mutants are made elsewhere, and of which layer: each corrupted fixture of the fresh
layer is refused by its row there, and by nothing else (`layer_mutants`)."""

TOLD = {
    _P.DOOR: "arrival", _P.ARRIVAL: "arrival", _P.STUB: "stub",
    _P.QUEUE: "queue", _P.NEXT: "queue", _P.ROOM: "queue",
}  # fmt: skip
"""Where a journal says that a place refused, if it does. The others hold, or cut a chunk short."""


def both_ask(name: str) -> bool:
    """Whether executor and stub must both ask a row."""
    places = set(PLACES[name].places) - {_P.LAYER}
    return _P.OBSERVED in places or (_P.STUB in places and len(places) > 1)
