"""What happens on a rig so that nothing that was made before may be used any more."""

from collections.abc import Callable

from genpolicy.evidence.shadow.rig import Rig

Event = Callable[[Rig], object]
AWAY_M = 0.2
"""How far the arm is seen from where it was sent; more than a rig allows."""


def new_phase(rig: Rig) -> None:
    """Another phase is observed."""
    rig.phase = "insert"
    rig.observe()


def new_epoch(rig: Rig) -> None:
    """Another calibration is observed."""
    rig.epoch = "epoch-2"
    rig.observe()


def diverged(rig: Rig) -> None:
    """The arm is not where it was sent."""
    rig.observe(divergence_m=AWAY_M)


def a_person_takes_over_and_hands_back(rig: Rig) -> None:
    """A person intervenes, and hands back at once."""
    rig.executor.intervene(rig.now_s)
    rig.executor.hand_back(rig.now_s)


def stop_and_reset(rig: Rig) -> None:
    """The supervisor stops, and a person clears it at once."""
    rig.supervisor.emergency_stop(rig.now_s)
    rig.supervisor.human_reset(rig.now_s, "spotter")


def felt(rig: Rig) -> None:
    """A force event."""
    rig.executor.force_event(rig.now_s)


def collided(rig: Rig) -> None:
    """A collision event."""
    rig.executor.collision_event(rig.now_s)


def reset(rig: Rig) -> None:
    """A new session begins."""
    rig.executor.reset(rig.now_s)


EVENTS: dict[str, Event] = {
    "after_phase_transition": new_phase,
    "after_calibration_mismatch": new_epoch,
    "after_force_event": felt,
    "after_collision_event": collided,
    "after_observation_divergence": diverged,
    "after_intervention": a_person_takes_over_and_hands_back,
    "after_stop": stop_and_reset,
    "after_reset": reset,
}
"""By the row of the table that refuses what was made before."""
