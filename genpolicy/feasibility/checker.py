"""The feasibility checker: projection, then six layers in order, for one chunk or for many."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import POSITION, split_action
from genpolicy.contract.chunk import Projected, Proposal
from genpolicy.errors import ConfigError
from genpolicy.feasibility import layers
from genpolicy.feasibility.context import Context, Workspace
from genpolicy.feasibility.geometric import geometric
from genpolicy.feasibility.projection import project, smooth_rates
from genpolicy.feasibility.settings import CHECKS, CHECKS_BY_LAYER, LAYERS, FeasibilitySettings
from genpolicy.feasibility.smoothing import rate_excess
from genpolicy.feasibility.verdict import Verdict, judge_layer, not_reached
from genpolicy.robot.collision import CollisionModel
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.robot.limits import RobotLimits, limits_of

Array = NDArray[np.float64]


@dataclass
class _State:
    """One chunk on its way through the layers."""

    projected: Projected
    context: Context
    margins: dict[str, float]
    detail: str = ""
    alive: bool = True

    @property
    def row_count(self) -> int:
        rows = self.context.rows(len(self.projected.actions))
        return int(rows.stop) - int(rows.start)


class LayerChecker:
    """Projects and checks chunks for one robot in one scene; holds no state between calls.

    `FeasibilityChecker` in `admission` adds the decision to it.

    Args:
        scene_path: MJCF of the task.
        workspace: Where the TCP may be.
        settings: Thresholds.
        limits: Table of limits; the one that the settings name if None.
        disabled_checks: Names out of `CHECKS` to leave out. For tests and for the evidence that
            a missing check is noticed; never set it anywhere else.

    Raises:
        ConfigError: An unknown check, limits of another robot, or position limits that differ
            from those of the scene file.
    """

    def __init__(
        self,
        scene_path: Path,
        *,
        workspace: Workspace,
        settings: FeasibilitySettings,
        limits: RobotLimits | None = None,
        disabled_checks: frozenset[str] = frozenset(),
    ) -> None:
        self.settings = settings
        self.workspace = workspace
        self.limits = limits_of(settings.robot) if limits is None else limits
        self.disabled_checks = disabled_checks
        self.kinematics = ArmKinematics(scene_path)
        self.collision = CollisionModel(scene_path, self.kinematics)
        self._require_consistent()
        self._scales = {
            "projection_too_large": settings.position_change_limit_m,
            "rotation_not_orthonormal": settings.orthonormality_tolerance,
            "gripper_range": settings.gripper_upper_m,
            "workspace": 0.1,
            "unreachable": settings.position_tolerance_m,
            "singular": settings.condition_limit,
            "scene_collision": 0.1,
            "self_collision": 0.1,
            "swept_collision": 0.1,
            "joint_velocity": float(self.limits.velocity_rad_s.min()),
            "joint_acceleration": float(self.limits.acceleration_rad_s2.min()),
            "joint_jerk": float(self.limits.jerk_rad_s3.min()),
        }

    def project(self, proposal: Proposal, *, context: Context) -> Projected:
        """A chunk close by within rotations, workspace, gripper and rates; see `project_many`."""
        return self.project_many([proposal], [context])[0]

    def project_many(
        self, proposals: Sequence[Proposal], contexts: Sequence[Context]
    ) -> list[Projected]:
        """Project many proposals, each with its own context.

        What cannot be projected (not finite, of another shape, not reachable) is left for the
        layers to reject.
        """
        result = [
            project(p, context=c, settings=self.settings, workspace=self.workspace)
            for p, c in zip(proposals, contexts, strict=True)
        ]
        groups: dict[int, list[int]] = defaultdict(list)
        for i, (chunk, context) in enumerate(zip(result, contexts, strict=True)):
            rows = context.rows(len(chunk.actions))
            if np.isfinite(chunk.position_change_m) and rows.stop > rows.start:
                groups[rows.stop - rows.start].append(i)
        for members in groups.values():
            smoothed = self._smooth([result[i] for i in members], [contexts[i] for i in members])
            for i, chunk in zip(members, smoothed, strict=True):
                result[i] = chunk
        return result

    def _smooth(self, chunks: list[Projected], contexts: list[Context]) -> list[Projected]:
        """Least smoothed chunks whose joint path keeps the rate limits; else as they were."""
        limits = self._usable_limits()
        path, reached = self._seeded(chunks, contexts)
        options = {
            i: smooth_rates(
                chunk, path[i], context=contexts[i], settings=self.settings,
                workspace=self.workspace, kinematics=self.kinematics, limits=limits,
            )
            for i, chunk in enumerate(chunks) if reached[i]
        }  # fmt: skip
        chosen = list(chunks)
        while options:
            trial = {i: chunk for i, it in options.items() if (chunk := next(it, None))}
            if not trial:
                break
            rows = list(trial)
            path, reached = self._seeded(list(trial.values()), [contexts[i] for i in rows])
            for place, i in enumerate(rows):
                fixed = np.concatenate([contexts[i].q_cmd_history[-2:], contexts[i].q_cmd[None]])
                excess = rate_excess(
                    np.concatenate([fixed, path[place]]), seam=len(fixed), limits=limits,
                    period_s=self.settings.action_period_s,
                )  # fmt: skip
                if reached[place] and excess <= 1.0:
                    chosen[i] = trial[i]
                    del options[i]
            options = {i: it for i, it in options.items() if i in trial}
        return chosen

    def _seeded(
        self, chunks: list[Projected], contexts: list[Context]
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Inverse kinematics from the last commands, without restarts: (B, n, 7) and (B,)."""
        batch = layers.batch_of(chunks, contexts)
        size, rows = batch.actions.shape[:2]
        solved = self.kinematics.solve(
            batch.actions[..., POSITION].reshape(-1, 3),
            batch.rotation.reshape(-1, 3, 3),
            q_seed_rad=np.repeat(batch.q_cmd_rad, rows, axis=0),
        )
        reached = np.array([part.all() for part in solved.converged.reshape(size, rows)])
        return solved.q_rad.reshape(size, rows, -1), reached

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
            evaluate_all: Also evaluate layers behind the first that rejects (where the chunk is
                finite), for evidence; the first reason stays the same.
        """
        states = [
            _State(p, c, layers.representation(p, context=c, settings=self.settings))
            for p, c in zip(projected, contexts, strict=True)
        ]
        computable = [s for s in states if _computable(s)]
        for state in states:
            state.alive = self._passes(state, "representation")
        groups: dict[int, list[_State]] = defaultdict(list)
        for state in computable:
            if state.alive or evaluate_all:
                groups[state.row_count].append(state)
        for group in groups.values():
            self._motion(group, evaluate_all)
        for state in states:
            if state.alive or evaluate_all:
                state.margins |= layers.fresh(state.projected.metadata, state.context)
        return [self._verdict(state, evaluate_all) for state in states]

    def solve(self, projected: Projected, *, context: Context) -> Array:
        """Joint positions of the executable rows, as the kinematic layer sees them. (n, 7)."""
        batch = layers.batch_of([projected], [context])
        return self.ik_chunk(batch.actions[0], context.q_cmd)[0]

    def boundary_jerk_m_s3(self, projected: Projected, *, context: Context) -> float:
        """Largest jerk of the TCP over the seam, m/s^3; NaN where fewer than four points exist.

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
        jerk = np.diff(path, n=3, axis=0) / self.settings.action_period_s**3
        return float(np.max(np.linalg.norm(jerk, axis=1)))

    def ik_chunk(self, actions: Array, q_start: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Inverse kinematics of a chunk.

        Args:
            actions: Shape (n, D_a).
            q_start: Where the arm stands, rad. Shape (7,).

        Returns:
            Joint positions, rad, shape (n, 7), and whether each row is reached, shape (n,).
        """
        position, rotation, _ = split_action(np.asarray(actions, dtype=float))
        q, position_error, rotation_error = layers.solve_chunks(
            self.kinematics, position[None], rotation[None], q_start_rad=np.asarray(q_start)[None]
        )
        reached = (position_error[0] <= self.settings.position_tolerance_m) & (
            rotation_error[0] <= self.settings.rotation_tolerance_rad
        )
        return q[0], reached

    def _usable_limits(self) -> RobotLimits:
        """The robot's limits times the factors of the settings."""
        return replace(
            self.limits,
            velocity_rad_s=self.limits.velocity_rad_s * self.settings.velocity_factor,
            acceleration_rad_s2=self.limits.acceleration_rad_s2 * self.settings.acceleration_factor,
            jerk_rad_s3=self.limits.jerk_rad_s3 * self.settings.jerk_factor,
        )

    def _motion(self, states: list[_State], evaluate_all: bool) -> None:
        """Kinematic, geometric, dynamic and contact layer of chunks with equally many rows."""
        batch = layers.batch_of([s.projected for s in states], [s.context for s in states])
        margins, q = layers.kinematic(
            batch, kinematics=self.kinematics, settings=self.settings, workspace=self.workspace
        )
        self._record(states, margins, "kinematic")
        usable = np.all(np.isfinite(q), axis=(1, 2))
        chosen = [i for i, s in enumerate(states) if usable[i] and (s.alive or evaluate_all)]
        if not chosen:
            return
        states = [states[i] for i in chosen]
        q = q[chosen]
        batch = layers.batch_of([s.projected for s in states], [s.context for s in states])
        margins, details = geometric(
            batch,
            q,
            collision=self.collision,
            settings=self.settings,
            disabled=self.disabled_checks,
        )
        for state, detail in zip(states, details, strict=True):
            state.detail = detail
        self._record(states, margins, "geometric")
        chosen = [i for i, s in enumerate(states) if s.alive or evaluate_all]
        if not chosen:
            return
        states, q = [states[i] for i in chosen], q[chosen]
        batch = layers.batch_of([s.projected for s in states], [s.context for s in states])
        self._record(
            states,
            layers.dynamic(batch, q, limits=self._usable_limits(), settings=self.settings),
            "dynamic",
        )
        self._record(
            states,
            layers.contact(batch, settings=self.settings, shapes=self.collision.shapes),
            "contact",
        )

    def _record(self, states: list[_State], margins: layers.Margins, layer: str) -> None:
        for name, values in margins.items():
            for state, value in zip(states, values, strict=True):
                state.margins[name] = float(value)
        for state in states:
            state.alive = state.alive and self._passes(state, layer)

    def _passes(self, state: _State, layer: str) -> bool:
        return bool(judge_layer(layer, state.margins, self._scales, self.disabled_checks).passed)

    def _verdict(self, state: _State, evaluate_all: bool) -> Verdict:
        found, rejected = [], False
        for name in LAYERS:
            evaluated = any(check in state.margins for check in CHECKS_BY_LAYER[name])
            if rejected and not (evaluate_all and evaluated):
                found.append(not_reached(name))
                continue
            verdict = judge_layer(name, state.margins, self._scales, self.disabled_checks)
            rejected = rejected or verdict.passed is not True
            found.append(verdict)
        rows = state.context.rows(len(state.projected.actions)) if _shaped(state) else slice(0, 0)
        return Verdict(tuple(found), dict(state.margins), (rows.start, rows.stop), state.detail)

    def _require_consistent(self) -> None:
        unknown = self.disabled_checks - set(CHECKS)
        if unknown:
            raise ConfigError(
                where="disabled_checks",
                found=f"holding {sorted(unknown)}",
                expected=f"names out of {list(CHECKS)}",
                action="Correct the name.",
            )
        if self.limits.robot != self.settings.robot:
            raise ConfigError(
                where="limits",
                found=f"of the robot {self.limits.robot}",
                expected=f"the table of {self.settings.robot}, as the settings say",
                action="Never mix the limits of two robots.",
            )
        same = np.allclose(self.kinematics.lower_rad, self.limits.position_lower_rad, atol=1e-9)
        same &= np.allclose(self.kinematics.upper_rad, self.limits.position_upper_rad, atol=1e-9)
        if not same:
            raise ConfigError(
                where=f"{self.kinematics.scene_path.name}: joint ranges",
                found="other than the position limits of the table",
                expected=f"those of {self.limits.robot}",
                action="Use the scene and the limits of one robot.",
            )


def _computable(state: _State) -> bool:
    """The projected rows are numbers that kinematics and collision may be asked about."""
    actions = state.projected.actions
    return _shaped(state) and bool(np.all(np.isfinite(actions)))


def _shaped(state: _State) -> bool:
    return state.margins["shape"] >= 0
