"""Deaf supervisors: without each of the things that stop, does anything still stop?

What stops is no row of a table: a force, a collision and an emergency stop ask nobody, and no table
that somebody brings may take one away. So the mutant is a supervisor that is deaf to one of them.
Whoever told it counts the actions that the controller accepted afterwards (`stub.accepted`). No
journal says of what force, collision or stop a supervisor was not told, so that the independent
checker cannot know; of a silence, and of a stop that was forgotten by one that began anew, it can,
and must say so.
"""

import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, cast

from genpolicy.evidence.documents.shadow import EXECUTION, ExecutionMutant
from genpolicy.evidence.shadow.mutants import DECLARATION
from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.execution.checks import CHECKS, Checks
from genpolicy.execution.figures import expected_settings
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.execution.supervisor import Supervisor
from genpolicy.verification.checker import check_journal

PREFIX = "deaf_to_"
COUNTED = "stub.accepted"
"""What stands for the rule: actions that were accepted after a stop was asked for."""
TICKS = 3
SILENCE_S = 1.0
"""After which the supervisor of the rig stops."""


def _force(rig: Rig) -> None:
    limits = rig.cell.execution.force_limit_n
    rig.supervisor.observe_force(rig.now_s, 2 * max(limits.values()), rig.phase)


def _force_of_another_phase(rig: Rig) -> None:
    """A force that only the phase with the largest limit bears."""
    limits = rig.cell.execution.force_limit_n
    rig.supervisor.observe_force(rig.now_s, max(limits.values()), rig.phase)


def _felt(force_n: object) -> Callable[[Rig], object]:
    """Whatever somebody says that was felt."""
    return lambda rig: rig.supervisor.observe_force(rig.now_s, cast(Any, force_n), rig.phase)


def _collision(rig: Rig) -> None:
    rig.supervisor.observe_collision(rig.now_s, True)


def _emergency_stop(rig: Rig) -> None:
    rig.supervisor.emergency_stop(rig.now_s)


def _silence(rig: Rig) -> None:
    """Nobody commands for longer than the limit, and then a chunk comes."""
    rig.advance(1.5 * SILENCE_S)
    _new_chunk(rig)


def _restart(rig: Rig) -> None:
    """A stop stands, its supervisor dies, another one of its kind takes over, and a chunk comes."""
    rig.supervisor.emergency_stop(rig.now_s)
    rig.supervisor = type(rig.supervisor)(rig.cell.execution, rig.journal, checks=rig.stub.checks)
    rig.stub.supervisor = rig.supervisor
    rig.tick()
    _new_chunk(rig)


def _new_chunk(rig: Rig) -> None:
    rig.observe()
    rig.deliver(rig.chunk(predecessor_chunk_id=""))


class DeafToForce(Supervisor):
    """Stops for no force."""

    def observe_force(self, now_s: float, force_n: float, phase: str) -> bool:
        """Hears nothing."""
        return False


class DeafToNan(Supervisor):
    """Bears a force that is no number, as a comparison with a limit does."""

    def observe_force(self, now_s: float, force_n: float, phase: str) -> bool:
        """Hears what is a number."""
        number = not (isinstance(force_n, float) and math.isnan(force_n))
        return number and super().observe_force(now_s, force_n, phase)


class DeafToNegativeForce(Supervisor):
    """Bears a force below zero, which no sensor measured."""

    def observe_force(self, now_s: float, force_n: float, phase: str) -> bool:
        """Hears what is a size."""
        size = not (isinstance(force_n, float) and force_n < 0)
        return size and super().observe_force(now_s, force_n, phase)


class DeafToUnknownForce(Supervisor):
    """Takes a force that nobody knows for none."""

    def observe_force(self, now_s: float, force_n: float, phase: str) -> bool:
        """Hears what is known."""
        return force_n is not None and super().observe_force(now_s, force_n, phase)


class DeafToUnknownCollision(Supervisor):
    """Takes a collision that nobody knows of for none."""

    def observe_collision(self, now_s: float, collision: bool) -> bool:
        """Hears what is known."""
        return collision is not None and super().observe_collision(now_s, collision)


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


class DeafToSilence(Supervisor):
    """Holds, however long nobody commands."""

    def __init__(
        self, settings: ExecutionSettings, journal: Journal, *, checks: Checks = CHECKS
    ) -> None:
        super().__init__(settings, journal, checks=checks)
        self._silence_ns = None


class DeafToRestart(Supervisor):
    """Takes over in a session that runs, and begins as if it were the first."""

    def __init__(
        self, settings: ExecutionSettings, journal: Journal, *, checks: Checks = CHECKS
    ) -> None:
        super().__init__(settings, Journal(journal.session), checks=checks)
        self._journal = journal


class Deaf(NamedTuple):
    """A supervisor that is deaf to what stops.

    Attributes:
        supervisor: Its class.
        tell: How it is told.
        rule: What the independent checker must say; empty where no journal tells.
    """

    supervisor: type[Supervisor]
    tell: Callable[[Rig], object]
    rule: str = ""


DEAF = {
    "force": Deaf(DeafToForce, _force),
    "collision": Deaf(DeafToCollision, _collision),
    "emergency_stop": Deaf(DeafToEmergencyStop, _emergency_stop),
    "phase": Deaf(DeafToPhase, _force_of_another_phase),
    "silence": Deaf(DeafToSilence, _silence, "P7.silence"),
    "restart": Deaf(DeafToRestart, _restart, "P7.stop"),
    "nan_force": Deaf(DeafToNan, _felt(math.nan)),
    "negative_force": Deaf(DeafToNegativeForce, _felt(-5.0)),
    "unknown_force": Deaf(DeafToUnknownForce, _felt(None)),
    "unknown_collision": Deaf(
        DeafToUnknownCollision,
        lambda rig: rig.supervisor.observe_collision(rig.now_s, cast(Any, None)),
    ),
}
"""What stops, and the supervisor that is deaf to it."""


def stop_mutants() -> list[ExecutionMutant]:
    """Tell a hearing and a deaf supervisor of each thing that stops; one row for each."""
    found = []
    for name, deaf in DEAF.items():
        unchanged, objections = told(Supervisor, deaf.tell)
        mutant, rules = told(deaf.supervisor, deaf.tell)
        seen = deaf.rule in rules or not deaf.rule
        found.append(
            ExecutionMutant(
                check=f"{PREFIX}{name}",
                layer=EXECUTION,
                detected=mutant > 0 and seen and unchanged + len(objections) == 0,
                violations=mutant,
                rules=[*rules, COUNTED] if mutant else rules,
                violations_unchanged=unchanged + len(objections),
                slipped=0,
            )
        )
    return found


def told(supervisor: type[Supervisor], tell: Callable[[Rig], object]) -> tuple[int, list[str]]:
    """What happens after a supervisor was told to stop.

    Returns:
        Actions that the controller accepts then, and rules that the independent checker says are
        broken.
    """
    rig = Rig(supervisor=supervisor, session="stop", silence_stop_s=SILENCE_S)
    rig.run(2)
    before = rig.stub.accepted
    assert before == 2, "nothing that moves can be stopped"
    tell(rig)
    rig.tick(TICKS)
    rig.executor.end_episode(rig.now_s)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "journal.mcap"
        write_journal(path, [rig.journal])
        report = check_journal(path, expected_settings(rig.cell))
    rules = {violation.rule for violation in report.violations} - {DECLARATION}
    return rig.stub.accepted - before, sorted(rules)
