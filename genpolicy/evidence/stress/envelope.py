"""The trial card's envelope in the comparison: rollouts that are held to it, and what they did.

A card allows a smaller workspace and a lower speed than the cell. Whether the policies still work
there is not known from rollouts that ran elsewhere, so one planned condition runs all of them with
the card's numbers as limits of feasibility. They may only be tighter than those of the cell.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from genpolicy.errors import ConfigError
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.documents.stress import Envelope
from genpolicy.evidence.stress.perturbations import Perturbation, ReducedEnvelope
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.tasks.api import Task
from genpolicy.verification.commands import Reach


@dataclass(frozen=True)
class Box:
    """Where the TCP may be; base frame, m."""

    lower_m: tuple[float, float, float]
    upper_m: tuple[float, float, float]


def checker_under(
    schedule: Perturbation,
    task: Task,
    settings: FeasibilitySettings,
    *,
    action_period_s: float,
) -> FeasibilityChecker:
    """The six layers of a condition: those of the cell, or of the card's envelope.

    Args:
        schedule: The condition.
        task: Scene, workspace, robot and phases.
        settings: Thresholds of the cell.
        action_period_s: The controller's period, s.

    Raises:
        ConfigError: The envelope is looser than the cell somewhere.
    """
    checker = make_checker(task, settings, action_period_s=action_period_s)
    if not isinstance(schedule, ReducedEnvelope):
        return checker
    require_tighter(schedule, task, settings)
    speed_m_s = schedule.speed_limit_m_s
    tighter = settings.model_copy(
        update={
            "tcp_speed_limit_m_s": speed_m_s,
            "contact_speed_limit_m_s": min(speed_m_s, settings.contact_speed_limit_m_s),
        }
    )
    workspace = Box(schedule.workspace_lower_m, schedule.workspace_upper_m)
    cell = replace(checker.cell, settings=tighter, workspace=workspace)
    return FeasibilityChecker(cell, checks=checker.checks)


def require_tighter(envelope: ReducedEnvelope, task: Task, settings: FeasibilitySettings) -> None:
    """Refuse an envelope that would allow what the cell does not.

    Raises:
        ConfigError: A corner outside the task's workspace, or a speed above the cell's.
    """
    lower, upper = task.workspace.lower_m, task.workspace.upper_m
    for name, found, inside in (
        ("workspace_lower_m", envelope.workspace_lower_m, lower),
        ("workspace_upper_m", envelope.workspace_upper_m, upper),
    ):
        if not all(
            low <= value <= high for low, value, high in zip(lower, found, upper, strict=True)
        ):
            _refuse(name, found, f"inside the task's workspace, at the most {list(inside)}")
    if not envelope.speed_limit_m_s <= settings.tcp_speed_limit_m_s:
        text = f"at most the cell's {settings.tcp_speed_limit_m_s} (tcp_speed_limit_m_s)"
        _refuse("speed_limit_m_s", envelope.speed_limit_m_s, text)


def envelope_document(
    name: str, envelope: ReducedEnvelope, reached: Mapping[str, Reach]
) -> Envelope:
    """Content of `envelope.json`: the limits, and how far the commands of each method went.

    Args:
        name: Name of the condition.
        envelope: Its limits.
        reached: By method, from its journal.
    """
    return Envelope(
        condition=name,
        workspace_lower_m=envelope.workspace_lower_m,
        workspace_upper_m=envelope.workspace_upper_m,
        speed_limit_m_s=envelope.speed_limit_m_s,
        reached={method: reach.as_document() for method, reach in sorted(reached.items())},
    )


def _refuse(name: str, found: object, expected: str) -> None:
    raise ConfigError(
        where=f"params.yaml: stress.perturbations.envelope.{name}",
        found=repr(found),
        expected=expected,
        action="Tighten it; a trial is never allowed more than the cell.",
    )
