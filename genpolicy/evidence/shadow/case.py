"""A case: a chunk and what it is checked against, and cases built where one check decides.

A damaged chunk that two checks refuse shows neither of them awake. So a case is built at the
margin of its own check: the arm stands still somewhere, or makes one step at a constant rate, and
everything else is within its limits. What a task calls its phases and bodies stands in the case;
where the arm can stand or go is asked of the robot.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER, POSITION, join_action
from genpolicy.contract.chunk import Projected, Proposal
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker, Rejected
from genpolicy.feasibility.context import Context
from genpolicy.robot.scene_state import SceneState

Array = NDArray[np.float64]

TOGETHER = 3  # cases that are tried at once


@dataclass(frozen=True)
class Case:
    """A chunk and what it is checked against.

    Attributes:
        proposal: The chunk.
        context: State at the check.
        poses: Scene bodies by name, as observed.
        obstacles: Those of them that are only in the way.
        free_phases: The task's phases of motion in the open.
        unprojected: The chunk is judged as it is, as after a projection that repairs nothing:
            what projection removes cannot be shown to the checks behind it otherwise.
        tcp_m: Where the TCP is seen, m; None: where it was commanded to last. Shape (3,).
    """

    proposal: Proposal
    context: Context
    poses: dict[str, tuple[Array, Array]]
    obstacles: tuple[str, ...] = ()
    free_phases: frozenset[str] = frozenset()
    unprojected: bool = False
    tcp_m: Array | None = None

    @property
    def seen_m(self) -> Array:
        """Where the TCP is seen, m. Shape (3,)."""
        return self.context.last_action[POSITION] if self.tcp_m is None else self.tcp_m

    def with_actions(self, actions: Array) -> "Case":
        """The case with other actions."""
        return replace(self, proposal=replace(self.proposal, actions=actions))

    def with_metadata(self, **changes: object) -> "Case":
        """The case with other chunk metadata."""
        metadata = replace(self.proposal.metadata, **changes)  # type: ignore[arg-type]
        return replace(self, proposal=replace(self.proposal, metadata=metadata))

    def with_context(self, **changes: object) -> "Case":
        """The case in another context."""
        return replace(self, context=replace(self.context, **changes))  # type: ignore[arg-type]

    def with_body(self, name: str, position_m: Array, quaternion: Array) -> "Case":
        """The case with a body elsewhere: it stands there, and is checked and seen there."""
        poses = {**self.poses, name: (position_m, quaternion)}
        return replace(self, poses=poses).with_context(scene=SceneState(poses))

    def later(self, by_s: float) -> "Case":
        """The same from an observation that was made so much later; nothing has moved since."""
        was, context = self.proposal.metadata, self.context
        return self.with_metadata(
            chunk_id=f"{was.chunk_id}/later",
            condition_observation_event_time_s=was.condition_observation_event_time_s + by_s,
            action_start_time_s=was.action_start_time_s + by_s,
            valid_until_s=was.valid_until_s + by_s,
        ).with_context(
            now_s=context.now_s + by_s,
            latest_observation_event_time_s=context.latest_observation_event_time_s + by_s,
            state_time_s=context.measured_at_s + by_s,
        )

    def as_it_is(self) -> "Case":
        """The case judged without projection."""
        return replace(self, unprojected=True)


def decide(checker: FeasibilityChecker, case: Case) -> Admitted | Rejected:
    """What a checker says of a case."""
    if case.unprojected:
        return checker.admit_as_it_is(case.proposal, context=case.context)
    return checker.admit(case.proposal, context=case.context)


def newer_than(checker: FeasibilityChecker, case: Case) -> Admitted:
    """The same chunk from an observation one period later, admitted as the one of the case was."""
    result = decide(checker, case.later(checker.cell.action_period_s))
    assert isinstance(result, Admitted), "nothing that a layer asks has changed"
    return result


def refusals(checker: FeasibilityChecker, cases: Sequence[Case]) -> list[frozenset[str]]:
    """Names of all checks that refuse each of some cases, those behind the first included."""
    judged = [
        Projected(case.proposal, case.proposal.actions, 0.0, 0.0)
        if case.unprojected
        else checker.project(case.proposal, context=case.context)
        for case in cases
    ]
    verdicts = checker.check_many(judged, [case.context for case in cases], evaluate_all=True)
    return [
        frozenset(name for name, margin in verdict.margins.items() if not margin >= 0)
        for verdict in verdicts
    ]


def alone(
    checker: FeasibilityChecker, cases: Iterable[Case], check: str, behind: tuple[str, ...] = ()
) -> Case | None:
    """The first of some cases that this check refuses, and no other but those behind it."""
    listed = list(cases)
    for first in range(0, len(listed), TOGETHER):
        some = listed[first : first + TOGETHER]
        for case, names in zip(some, refusals(checker, some), strict=True):
            if check in names and names <= {check, *behind}:
                return case
    return None


def still(case: Case, checker: FeasibilityChecker, q_rad: Array, *, rows: int = 1) -> Case:
    """The arm stands at `q_rad` (J,), and is told to stay there for so many rows."""
    context = case.context
    target = _action(checker, q_rad, context.last_action[GRIPPER])
    actions = np.tile(target, (context.first_index + rows, 1))
    return (
        replace(case, tcp_m=None)
        .with_context(
            q_cmd=q_rad,
            q_meas=q_rad,
            last_action=target,
            q_cmd_history=np.tile(q_rad, (2, 1)),
            dq_meas=np.zeros(len(q_rad)),
            state_time_s=None,
        )
        .with_actions(actions)
    )


def moving(case: Case, checker: FeasibilityChecker, step_rad: Array) -> Case:
    """The arm goes on by one row as it came: `step_rad` (J,) in every period, no acceleration."""
    context = case.context
    q_rad, opening = context.q_cmd, context.last_action[GRIPPER]
    here = _action(checker, q_rad, opening)
    there = _action(checker, q_rad + step_rad, opening)
    actions = np.concatenate([np.tile(here, (context.first_index, 1)), there[None]])
    history = np.stack([q_rad - 2 * step_rad, q_rad - step_rad])
    moved = replace(case, tcp_m=None).with_context(
        q_meas=q_rad, last_action=here, q_cmd_history=history, state_time_s=None,
        dq_meas=step_rad / checker.cell.action_period_s,
    )  # fmt: skip
    return moved.with_actions(actions)


def _action(checker: FeasibilityChecker, q_rad: Array, opening_m: float) -> Array:
    position, rotation = checker.kinematics.forward(q_rad)
    return join_action(position, rotation, opening_m)
