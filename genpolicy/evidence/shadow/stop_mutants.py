"""Deaf supervisors: without each of the things that stop, does anything still stop?

What stops is no row of a table: a force, a collision and an emergency stop ask nobody, and no table
that somebody brings may take one away. So the mutant is a supervisor that is deaf to one of them.
No journal says what a supervisor was not told, and the independent checker cannot know: whoever
told it counts the actions that the controller accepted afterwards (`stub.accepted`).
"""

from collections.abc import Callable

from genpolicy.evidence.documents.shadow import EXECUTION, ExecutionMutant
from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.supervisor import Supervisor

PREFIX = "deaf_to_"
COUNTED = "stub.accepted"
"""What stands for the rule: actions that were accepted after a stop was asked for."""
TICKS = 3


def _force(rig: Rig) -> None:
    limits = rig.cell.execution.force_limit_n
    rig.supervisor.observe_force(rig.now_s, 2 * max(limits.values()), rig.phase)


def _force_of_another_phase(rig: Rig) -> None:
    """A force that only the phase with the largest limit bears."""
    limits = rig.cell.execution.force_limit_n
    rig.supervisor.observe_force(rig.now_s, max(limits.values()), rig.phase)


def _collision(rig: Rig) -> None:
    rig.supervisor.observe_collision(rig.now_s, True)


def _emergency_stop(rig: Rig) -> None:
    rig.supervisor.emergency_stop(rig.now_s)


class DeafToForce(Supervisor):
    """Stops for no force."""

    def observe_force(self, now_s: float, force_n: float, phase: str) -> bool:
        """Hears nothing."""
        return False


class DeafToCollision(Supervisor):
    """Stops for no collision."""

    def observe_collision(self, now_s: float, collision: bool) -> bool:
        """Hears nothing."""
        return False


class DeafToEmergencyStop(Supervisor):
    """Stops for nobody who asks it to."""

    def emergency_stop(self, now_s: float, detail: str = "") -> None:
        """Hears nothing."""


class DeafToPhase(Supervisor):
    """Stops only for a force that no phase bears."""

    def _bears_n(self, phase: str) -> float:
        return max(self.settings.force_limit_n.values())


DEAF: dict[str, tuple[type[Supervisor], Callable[[Rig], None]]] = {
    "force": (DeafToForce, _force),
    "collision": (DeafToCollision, _collision),
    "emergency_stop": (DeafToEmergencyStop, _emergency_stop),
    "phase": (DeafToPhase, _force_of_another_phase),
}
"""What stops: the supervisor that is deaf to it, and how it is told."""


def stop_mutants() -> list[ExecutionMutant]:
    """Tell a hearing and a deaf supervisor of each thing that stops; one row for each."""
    found = []
    for name, (deaf, tell) in DEAF.items():
        unchanged, mutant = accepted_after(Supervisor, tell), accepted_after(deaf, tell)
        found.append(
            ExecutionMutant(
                check=f"{PREFIX}{name}",
                layer=EXECUTION,
                detected=mutant > 0 and unchanged == 0,
                violations=mutant,
                rules=[COUNTED] if mutant else [],
                violations_unchanged=unchanged,
                slipped=0,
            )
        )
    return found


def accepted_after(supervisor: type[Supervisor], tell: Callable[[Rig], None]) -> int:
    """Actions that the controller accepts after its supervisor was told to stop."""
    rig = Rig(supervisor=supervisor, session="stop")
    rig.run(2)
    before = rig.stub.accepted
    assert before == 2, "nothing that moves can be stopped"
    tell(rig)
    rig.tick(TICKS)
    return rig.stub.accepted - before
