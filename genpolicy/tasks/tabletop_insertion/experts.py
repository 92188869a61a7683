"""Scripted operators: reactive, each with an own style, who pass the post left or right.

An operator never sees a policy and never sees the generator that chose the side. What is asked of
it (`kind`) is in the episode's plan: a plain success, a push to recover from, a detour, or one of
two failures.
"""

from collections.abc import Generator, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import join_action
from genpolicy.tasks.tabletop_insertion import scene
from genpolicy.tasks.tabletop_insertion.plans import ACTION_PERIOD_S, min_jerk, travel
from genpolicy.tasks.tabletop_insertion.world import TabletopWorld

Array = NDArray[np.float64]

KINDS = ("nominal", "pushed", "wander", "missed", "dropped")
RECOVERY_KINDS = frozenset({"pushed", "wander"})
SIDES = ("left", "right")

HOVER_HEIGHT_M = 0.030
INSERT_TCP_M = scene.FIXTURE_TOP_M + 0.014
LIFT_M = 0.085
ALIGNED_M = 0.0025
GIVE_UP_FORCE_N = 25.0
# Shares of the last step per period while braking to a stop, 0.25 s.
BRAKING = (0.9, 0.7, 0.45, 0.2, 0.05)


@dataclass(frozen=True)
class Style:
    """How one operator moves.

    Attributes:
        speed_m_s: Cruising speed.
        acceleration_m_s2: Acceleration along the path.
        via_m: Lateral distance from the post's axis when passing it.
        lift_m: Height gained while passing the post.
        tremor_m: Standard deviation of the hand's tremor.
        aim_m: Standard deviation of the aim at the hole.
        insert_speed_m_s: Speed of the insertion.
        dwell_s: Least time spent over the hole.
    """

    speed_m_s: float
    acceleration_m_s2: float
    via_m: float
    lift_m: float
    tremor_m: float
    aim_m: float
    insert_speed_m_s: float
    dwell_s: float


STYLES: dict[str, Style] = {
    "amber": Style(0.275, 1.3, 0.130, 0.000, 0.0003, 0.0006, 0.070, 0.15),
    "birch": Style(0.250, 1.2, 0.136, 0.010, 0.0004, 0.0008, 0.055, 0.25),
    "cedar": Style(0.300, 1.4, 0.126, 0.005, 0.0004, 0.0007, 0.080, 0.10),
    "delta": Style(0.260, 1.3, 0.133, -0.005, 0.0003, 0.0005, 0.060, 0.20),
}


@dataclass(frozen=True)
class Order:
    """What one episode asks of its operator.

    Attributes:
        kind: One of `KINDS`.
        side: One of `SIDES`: left passes at larger y than the post.
        style: How the operator moves.
    """

    kind: str
    side: str
    style: Style


def route(position_m: Array, hover_m: Array, *, side: str, style: Style, post_y_m: float) -> Array:
    """Points from here to above the hole, around the post on one side. Shape (n, 3), m."""
    sign = 1.0 if side == "left" else -1.0
    x = float(position_m[0])
    cruise_z = float(np.clip(hover_m[2] + 0.005 + style.lift_m, 0.14, 0.17))
    points = [position_m]
    if x < scene.POST_X_M - 0.10:
        early_z = 0.5 * (float(position_m[2]) + cruise_z)
        points.append(np.array([x + 0.052, post_y_m + sign * 0.72 * style.via_m, early_z]))
    if x < scene.POST_X_M - 0.02:
        points.append(np.array([scene.POST_X_M + 0.005, post_y_m + sign * style.via_m, cruise_z]))
    if x < scene.POST_X_M + 0.05:
        points.append(np.array([scene.POST_X_M + 0.085, 0.62 * sign * style.via_m, cruise_z]))
    points.append(hover_m)
    return np.array(points)


class Operator:
    """Demonstrates one episode, one action per call of `act`.

    Attributes:
        maximum_tries: How often it goes down to the hole before it lets go where it is.

    Args:
        world: The cell; the operator sees its true state.
        order: What to do.
        rng: The operator's own noise: tremor, aim, when a disturbance comes.
    """

    maximum_tries = 3

    def __init__(self, world: TabletopWorld, *, order: Order, rng: np.random.Generator) -> None:
        self._world, self._order, self._rng = world, order, rng
        self._style = order.style
        start = world.start
        self._hole = np.array([start.hole_x_m, start.hole_y_m])
        aim = self._style.aim_m * rng.standard_normal(2)
        if order.kind == "missed":
            angle = rng.uniform(0.0, 2.0 * np.pi)
            aim = rng.uniform(0.018, 0.024) * np.array([np.cos(angle), np.sin(angle)])
        self._aim = self._hole + aim
        self._yaw = start.yaw_rad
        self._opening = scene.GRASP_OPENING_M
        self._position = world.tcp_pose[0]
        self._step = np.zeros(3)
        self._tremor = np.zeros(3)
        self._event_share = float(rng.uniform(0.15, 0.6))
        self._disturbed = order.kind not in RECOVERY_KINDS
        self._script = self._run()

    def act(self) -> Array | None:
        """The next action, or None when the episode is over. Shape (10,)."""
        if next(self._script, None) is None:
            return None
        self._tremor += 0.35 * (self._style.tremor_m * self._rng.standard_normal(3) - self._tremor)
        rotation = scene.tool_rotation(self._yaw)
        return join_action(self._position + self._tremor, rotation, self._opening)

    def _run(self) -> Iterator[bool]:
        yield from self._approach()
        if self._order.kind == "dropped":
            yield from self._open()
            yield from self._wait(0.25)
        else:
            for _ in range(self.maximum_tries):
                yield from self._align()
                if (yield from self._descend()):
                    break
                if self._order.kind == "missed":
                    break
                yield from self._again()
            yield from self._open()
            yield from self._wait(0.15)
        top = self._position.copy()
        top[2] = max(float(top[2]), scene.FIXTURE_TOP_M) + LIFT_M
        yield from self._rise(top)
        yield from self._wait(0.25)

    def _hover(self) -> Array:
        height = scene.FIXTURE_TOP_M + scene.TIP_OFFSET_M + HOVER_HEIGHT_M
        return np.array([self._aim[0], self._aim[1], height])

    def _way(self) -> Array:
        """Points from here to above the hole. Shape (n, 3), m."""
        return route(
            self._position,
            self._hover(),
            side=self._order.side,
            style=self._style,
            post_y_m=self._world.start.post_y_m,
        )

    def _corrected(self) -> Array:
        """Where it aims after the peg stood on something. Shape (2,), m."""
        return self._hole.copy()

    def _stands(self) -> bool:
        """The peg stands on something on its way down."""
        return self._world.contact_force_n > GIVE_UP_FORCE_N

    def _again(self) -> Iterator[bool]:
        """Back to where it can go down once more."""
        yield from self._rise(self._hover())

    def _approach(self) -> Iterator[bool]:
        path = travel(
            self._way(),
            speed_m_s=self._style.speed_m_s,
            acceleration_m_s2=self._style.acceleration_m_s2,
        )
        yaw_from = self._yaw
        for index, position in enumerate(path):
            share = (index + 1) / len(path)
            self._step = position - self._position
            self._position = position.copy()
            self._yaw = yaw_from + min_jerk(share) * (self._world.start.hole_yaw_rad - yaw_from)
            yield True
            if not self._disturbed and share >= self._event_share:
                self._disturbed = True
                yield from self._disturbance()
                yield from self._approach()
                return
            if self._order.kind == "dropped" and share > 0.35 + 0.6 * self._event_share:
                yield from self._brake()
                return

    def _disturbance(self) -> Iterator[bool]:
        sign = 1.0 if self._order.side == "left" else -1.0
        away = np.array([self._rng.uniform(-0.6, 0.2), sign, self._rng.uniform(-0.2, 0.3)])
        away /= np.linalg.norm(away)
        pushed = self._order.kind == "pushed"
        if pushed:
            self._world.apply_force(self._rng.uniform(90.0, 120.0) * away, 0.25)
        yield from self._brake()
        if pushed:
            yield from self._wait(0.15)
            detour_m, speed_m_s = 0.015, 0.12
        else:
            detour_m, speed_m_s = float(self._rng.uniform(0.025, 0.04)), 0.15
        drift = self._position + detour_m * away
        drift[1] = np.clip(drift[1], -0.19, 0.19)
        if pushed:
            self._world.request_recovery(True)
        yield from self._move(drift, speed_m_s=speed_m_s)
        self._world.request_recovery(True)
        yield from self._wait(0.2)
        yield from self._move(self._position - 0.6 * detour_m * away, speed_m_s=0.12)
        self._world.request_recovery(False)

    def _brake(self) -> Iterator[bool]:
        step = self._step
        for share in BRAKING:
            self._position = self._position + share * step
            yield True

    def _align(self) -> Iterator[bool]:
        yield from self._wait(self._style.dwell_s)
        for _ in range(40):
            position, _ = self._world.tcp_pose
            if np.hypot(*(position[:2] - self._aim)) < ALIGNED_M:
                return
            self._position = self._hover()
            yield True

    def _descend(self) -> Generator[bool, None, bool]:
        target = self._hover()
        target[2] = INSERT_TCP_M
        path = travel(
            np.array([self._position, target]),
            speed_m_s=self._style.insert_speed_m_s,
            acceleration_m_s2=0.6,
        )
        for position in path:
            self._position = position.copy()
            yield True
            if self._stands():
                self._aim = self._corrected()
                return False
        yield from self._wait(0.1)
        return self._world.tip_depth_m > 0.03

    def _open(self) -> Iterator[bool]:
        begin = self._opening
        for index in range(6):
            share = min_jerk((index + 1) / 6)
            self._opening = begin + share * (scene.OPEN_OPENING_M - begin)
            yield True

    def _rise(self, target_m: Array) -> Iterator[bool]:
        yield from self._move(target_m, speed_m_s=0.2)

    def _move(self, target_m: Array, *, speed_m_s: float) -> Iterator[bool]:
        points = np.array([self._position, target_m])
        for position in travel(points, speed_m_s=speed_m_s, acceleration_m_s2=0.8):
            self._position = position.copy()
            yield True

    def _wait(self, duration_s: float) -> Iterator[bool]:
        for _ in range(round(duration_s / ACTION_PERIOD_S)):
            yield True
