"""The feasibility checker: projection, then six layers in order, for one chunk or for many."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import POSITION, split_action
from genpolicy.contract.chunk import Projected, Proposal
from genpolicy.feasibility.batch import Batch
from genpolicy.feasibility.cell import Cell
from genpolicy.feasibility.checks import CHECKS, Check, Measure, require_table
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.inverse import solve_chunks, solved
from genpolicy.feasibility.layers.representation import is_shaped
from genpolicy.feasibility.offence import offending_row
from genpolicy.feasibility.projection import project_many
from genpolicy.feasibility.reasons import Reason
from genpolicy.feasibility.settings import LAYERS, FeasibilitySettings
from genpolicy.feasibility.verdict import Verdict, judge_layer, not_answerable, not_reached
from genpolicy.robot.collision import CollisionModel
from genpolicy.robot.kinematics import ArmKinematics

Array = NDArray[np.float64]

FIRST, *MOTION, LAST = LAYERS
"""The first layer decides whether arrays may be made at all; the last looks at no action."""


@dataclass
class _State:
    """One chunk on its way through the layers."""

    projected: Projected
    context: Context
    shaped: bool
    margins: dict[str, float] = field(default_factory=dict)
    detail: str = ""
    alive: bool = True
    q_rad: Array | None = None

    @property
    def row_count(self) -> int:
        rows = self.context.rows(len(self.projected.actions))
        return int(rows.stop) - int(rows.start)


class LayerChecker:
    """Projects and checks chunks for one robot in one scene; holds no state between calls.

    `FeasibilityChecker` in `admission` adds the decision to it.

    Args:
        cell: Robot, scene, phases and thresholds.
        checks: Rows of the table that decide. Fewer than all of them are for the evidence that a
            missing check is noticed.

    Raises:
        ConfigError: The tuple is no table of checks.
    """

    def __init__(self, cell: Cell, *, checks: tuple[Check, ...] = CHECKS) -> None:
        require_table(checks)
        self.cell = cell
        self.checks = checks
        self._gauges = {
            layer: {check.name: check.gauge(cell) for check in checks if check.layer == layer}
            for layer in LAYERS
        }
        self._measures: dict[str, dict[Measure, list[str]]] = {layer: {} for layer in LAYERS}
        for check in checks:
            self._measures[check.layer].setdefault(check.measure, []).append(check.name)

    @property
    def settings(self) -> FeasibilitySettings:
        """Thresholds."""
        return self.cell.settings

    @property
    def kinematics(self) -> ArmKinematics:
        """The arm."""
        return self.cell.kinematics

    @property
    def collision(self) -> CollisionModel:
        """Collision queries in the scene."""
        return self.cell.collision

    def project(self, proposal: Proposal, *, context: Context) -> Projected:
        """A chunk close by within rotations, workspace, gripper and rates; see `project_many`."""
        return self.project_many([proposal], [context])[0]

    def project_many(
        self, proposals: Sequence[Proposal], contexts: Sequence[Context]
    ) -> list[Projected]:
        """Project many proposals, each with its own context.

        What cannot be projected (not finite, of another shape, not reachable) is left for the
        layers to reject.

        Raises:
            ContractError: A context is of another task or robot.
        """
        for context in contexts:
            self.cell.require_known(context)
        return project_many(proposals, contexts, self.cell)

    def check(
        self, projected: Projected, *, context: Context, evaluate_all: bool = False
    ) -> Verdict:
        """Verdict on one projected chunk; see `check_many`."""
        return self.check_many([projected], [context], evaluate_all=evaluate_all)[0]

    def check_many(
        self,
        projected: Sequence[Projected],
        contexts: Sequence[Context],
        *,
        evaluate_all: bool = False,
    ) -> list[Verdict]:
        """Verdicts on many chunks, each the same as if it were checked alone.

        Args:
            projected: The chunks.
            contexts: One per chunk.
            evaluate_all: Also evaluate layers behind the first that rejects, for evidence; the
                first reason stays the same. Those that a rejection leaves nothing to ask about
                (numbers that are none, a pose that no joint positions reach) are unknown.

        Raises:
            ContractError: A context is of another task or robot.
        """
        for context in contexts:
            self.cell.require_known(context)
        states = [_State(p, c, is_shaped(p, c)) for p, c in zip(projected, contexts, strict=True)]
        self._measure(FIRST, states, _batch(states))
        groups: dict[int, list[_State]] = defaultdict(list)
        for state in states:
            if (state.alive or evaluate_all) and state.shaped:
                groups[state.row_count].append(state)
        for group in groups.values():
            self._motion(group, evaluate_all)
        asked = [state for state in states if state.alive or evaluate_all]
        self._measure(LAST, asked, _batch(asked))
        return [self._verdict(state, evaluate_all) for state in states]

    def located(self, projected: Projected, verdict: Verdict, *, context: Context) -> Verdict:
        """The verdict with the first offending row of every layer that did not pass.

        Args:
            projected: The chunk.
            verdict: This checker's verdict on it.
            context: What it was checked against.
        """
        checks = {check.name: check for check in self.checks}
        layers = [
            replace(
                layer,
                row=offending_row(checks[layer.check], projected, context=context, cell=self.cell),
            )
            if layer.passed is False and layer.check is not None
            else layer
            for layer in verdict.layers
        ]
        return replace(verdict, layers=tuple(layers))

    def boundary_jerk_m_s3(self, projected: Projected, *, context: Context) -> float:
        """Largest jerk of the TCP over the boundary, m/s^3; NaN where fewer than four points exist.

        The points are the earlier commands of the context, its last action, and the first three
        executable rows.
        """
        rows = projected.actions[context.rows(len(projected.actions))]
        if rows.ndim != 2 or not np.all(np.isfinite(rows)):
            return float("nan")
        earlier = self.kinematics.forward(context.q_cmd_history[-2:])[0]
        path = np.concatenate([earlier, context.last_action[None, POSITION], rows[:3, POSITION]])
        if len(path) < 4:
            return float("nan")
        jerk = np.diff(path, n=3, axis=0) / self.cell.action_period_s**3
        return float(np.max(np.linalg.norm(jerk, axis=1)))

    def ik_chunk(self, actions: Array, q_start: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Inverse kinematics of a chunk.

        Args:
            actions: Shape (n, D_a).
            q_start: Where the arm stands, rad. Shape (J,).

        Returns:
            Joint positions, rad, shape (n, J), and whether each row is reached, shape (n,).
        """
        position, rotation, _ = split_action(np.asarray(actions, dtype=float))
        found = solve_chunks(
            self.kinematics, position[None], rotation[None], q_start_rad=np.asarray(q_start)[None]
        )
        reached = (found.position_error_m[0] <= self.settings.position_tolerance_m) & (
            found.rotation_error_rad[0] <= self.settings.rotation_tolerance_rad
        )
        return found.q_rad[0], reached

    def _motion(self, states: list[_State], evaluate_all: bool) -> None:
        """Kinematic, geometric, dynamic and contact layer of chunks with equally many rows.

        Kinematics and collision are asked about numbers only: a chunk with a row that is none is
        asked nothing here.
        """
        batch = _batch(states)
        finite = np.flatnonzero(np.isfinite(batch.actions).all(axis=(1, 2)))
        if not len(finite):
            return
        states, batch = [states[i] for i in finite], solved(batch.take(finite), self.cell)
        usable = np.all(np.isfinite(batch.solved.q_rad), axis=(1, 2))
        for state, q_rad in zip(states, batch.solved.q_rad, strict=True):
            state.q_rad = q_rad
        for layer in MOTION:
            self._measure(layer, states, batch)
            left = [i for i, s in enumerate(states) if usable[i] and (s.alive or evaluate_all)]
            if not left:
                return
            states, batch, usable = [states[i] for i in left], batch.take(left), usable[left]

    def _measure(self, layer: str, states: list[_State], batch: Batch) -> None:
        """Margins of one layer; its second measure is made where the first rejected nothing."""
        left = np.arange(len(states))
        for measure, names in self._measures[layer].items():
            if not len(left):
                break
            found = measure(batch.take(left), self.cell)
            asked = [states[i] for i in left]
            margins = np.array([found.values[name] for name in names])
            for state, values in zip(asked, margins.T.tolist(), strict=True):
                state.margins.update(zip(names, values, strict=True))
            for state, detail in zip(asked, found.details, strict=bool(found.details)):
                state.detail = state.detail or detail
            left = left[np.all(margins >= 0, axis=0)]
        passed = set(left.tolist())
        for i, state in enumerate(states):
            state.alive = state.alive and i in passed

    def _verdict(self, state: _State, evaluate_all: bool) -> Verdict:
        found, rejected = [], False
        for layer, gauges in self._gauges.items():
            if rejected and not evaluate_all:
                found.append(not_reached(layer))
            elif rejected and not self._answerable(state, layer):
                found.append(not_answerable(layer, next(v.reason for v in found if v.reason)))
            else:
                found.append(judge_layer(layer, state.margins, gauges))
                rejected = rejected or not found[-1].passed
        rows = state.context.rows(len(state.projected.actions)) if state.shaped else slice(0, 0)
        place = (rows.start, rows.stop)
        return Verdict(tuple(found), dict(state.margins), place, state.detail, state.q_rad)

    def _answerable(self, state: _State, layer: str) -> bool:
        """Whether a layer behind a rejection was asked about something that there is."""
        reached = state.margins.get(Reason.UNREACHABLE, 0.0) >= 0 or layer not in MOTION[1:]
        return reached and any(check in state.margins for check in self._gauges[layer])


def _batch(states: Sequence[_State]) -> Batch:
    return Batch(tuple(s.projected for s in states), tuple(s.context for s in states))
