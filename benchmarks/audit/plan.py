"""What is planted in one data set, and who recorded which episode when.

Everything that is not planted is nuisance, drawn from the seed: number of episodes, operators and
their speed, objects, small clock and calibration errors that every cell has, which strata were
recorded, disturbed and failed episodes. No draw depends on what the audit would say.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from genpolicy.seeds import stream

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

OPERATORS = ("amber", "birch", "cedar")
OBJECTS = ("peg_a", "peg_b")
# What decides the mode of an episode; `chance` is a free choice of the operator.
DECIDERS = (
    "chance", "operator", "object", "calibration_epoch", "session", "alternation",
    "lamp_early", "path_early", "lamp", "goal", "habit", "drift",
)  # fmt: skip
# What modes may differ in.
DIFFER = ("position", "rotation", "gripper", "timing")
# Episodes that are not as they should be in every data set: disturbed ones and honest failures.
RECOVERY_SHARE = 0.08
FAILURE_SHARE = 0.03
# No route lies further out than so many times its spread.
STRAY = 6.0


@dataclass(frozen=True)
class Defect:
    """One fault of the recording.

    Attributes:
        kind: Name of the fault, see `defects.py`.
        size: Its size: seconds, metres, a factor, radians or a share, by kind.
        scope: `epoch` (all episodes of the last epoch), `some` (a share of all episodes) or `all`.
        share: Share of the episodes where the scope is `some`.
    """

    kind: str
    size: float = 1.0
    scope: str = "epoch"
    share: float = 1.0


@dataclass(frozen=True)
class Plan:
    """What is planted in one data set.

    Attributes:
        seed: Seed of every draw.
        shares: Share of each mode, the first the largest; one mode for (1.0,).
        width: Distance of the first two modes' routes, relative to the task's usual one.
        decided_by: One of `DECIDERS`.
        fidelity: How often the decider decides; otherwise chance does. Of `habit`, how often the
            episode before is repeated without a choice; of `drift`, how far the share of the second
            mode moves over the session, evenly and about one half.
        correlation: Share of episodes in which object and operator go together, and operators come
            by epochs.
        contexts: Clusters of goals, each with all the modes.
        goal_half_width_m: Half width of the goal's lateral position; None takes the task's.
        start_wide: Half width of the start position, relative to the task's.
        differ: What the modes differ in, one of `DIFFER`; beside the position there is one route.
        apart: How far, by component: angle of the tool (rad), share of the path at which the
            gripper closes, or factor of the speeds.
        free: Instead of two modes, every episode draws the same evenly between the two.
        route_spread_m: Standard deviation of the width of the routes of one mode.
        tremor_m: Standard deviation of white noise on every command.
        station_dwell_s: How long the arm rests, twice, at one place, before it goes one way in the
            first phase and another in the second; 0: it does not go to the station.
        phase_observed: Whether a policy would see the phase.
        failing: Share of the last mode's episodes that fail.
        tails: Degrees of freedom of Student's t for the width of the routes, of the same scale; 0
            is the normal distribution.
        wrong_labels: Share of labels that are wrong.
        wrong_mode_only: Wrong labels are those of the last mode only.
        episodes: Number of episodes; None draws 100 to 200.
        object_move_m: How far the goal moves to one side or the other in the course of the motion,
            the operator with it; evenly up to that far, or, with `object_jumps`, always so far.
        object_jumps: See there.
        recoveries: How many of them, the last ones, are disturbed beside those by chance.
        exact: Nothing but what is planted, for tests that need exact numbers. The plant follows one
            action period later and goes at once; sensors and clocks have no error, and a clock
            fault makes the samples late; there are two epochs; every stratum is recorded, receive
            times are not; no episode fails or is disturbed by chance.
        defects: Faults of the recording.
    """

    seed: int
    shares: tuple[float, ...] = (1.0,)
    width: float = 1.0
    decided_by: str = "chance"
    fidelity: float = 1.0
    correlation: float = 0.0
    contexts: int = 1
    goal_half_width_m: float | None = None
    start_wide: float = 1.0
    differ: str = "position"
    apart: float = 0.0
    free: bool = False
    route_spread_m: float = 0.008
    tremor_m: float = 0.0005
    station_dwell_s: float = 0.0
    phase_observed: bool = True
    failing: float = 0.0
    tails: float = 0.0
    wrong_labels: float = 0.0
    wrong_mode_only: bool = False
    episodes: int | None = None
    object_move_m: float = 0.0
    object_jumps: bool = False
    recoveries: int = 0
    exact: bool = False
    defects: tuple[Defect, ...] = field(default=())

    def __post_init__(self) -> None:
        if self.decided_by not in DECIDERS or abs(sum(self.shares) - 1.0) > 1e-9:
            raise ValueError(f"{self.decided_by} decides, shares {self.shares}")
        if self.differ not in DIFFER:
            raise ValueError(f"modes differ in {self.differ}")

    @property
    def tool(self) -> bool:
        """Whether the tool turns and grips on the way."""
        return self.differ in ("rotation", "gripper")

    def spread(self, rng: np.random.Generator) -> float:
        """Deviation of one route's width from its operator's, m."""
        drawn = rng.standard_t(self.tails) if self.tails else rng.normal()
        # A stray goes round, never through: a way that far out is not gone.
        return self.route_spread_m * float(np.clip(drawn, -STRAY, STRAY))

    def moved(self, ticks: int, motion: tuple[int, int], number: int) -> Array | None:
        """How far an episode's goal has moved to the side at each tick. Shape (T, 2).

        The arm sets out at the first tick of `motion` and takes as many as the second. The goal
        sets out up to a third of them later, and takes a quarter.
        """
        if not self.object_move_m:
            return None
        rng = stream(self.seed, "object", number)
        far = rng.choice([-1.0, 1.0]) * (1.0 if self.object_jumps else rng.uniform(0.0, 1.0))
        first, long = motion
        begin = first + long * rng.uniform(0.05, 0.3)
        share = np.clip((np.arange(ticks) - begin) / (0.25 * long), 0.0, 1.0)
        lateral = self.object_move_m * far * share * share * (3.0 - 2.0 * share)
        return np.column_stack([np.zeros(ticks), lateral])

    @property
    def by_chance(self) -> float:
        """Factor of every error and mishap that is not planted."""
        return 0.0 if self.exact else 1.0


@dataclass(frozen=True)
class Roster:
    """Who recorded which episode when, and how; arrays of shape (E,).

    Attributes:
        operator: Name.
        object: Name.
        epoch: Number of the calibration epoch, in order of time.
        mode: Mode of the episode.
        cue: The mode that the decider stands for, where it is seen in the episode.
        context: Cluster of the goal.
        goal_lateral_m: The goal's lateral position relative to its cluster.
        recovery: Disturbed.
        failure: Fails honestly.
        split: train, validation or test.
    """

    operator: NDArray[np.str_]
    object: NDArray[np.str_]
    epoch: Integers
    mode: Integers
    cue: Integers
    context: Integers
    goal_lateral_m: Array
    recovery: NDArray[np.bool_]
    failure: NDArray[np.bool_]
    split: NDArray[np.str_]


def draw_roster(plan: Plan, goal_half_width_m: float) -> Roster:
    """Who recorded which episode when; the goal's half width is the task's own."""
    rng = stream(plan.seed, "roster")
    n = plan.episodes or int(rng.integers(100, 201))
    blocks = bool(rng.random() < 0.5)  # operators take turns, or come at random
    turns = np.arange(n) // int(rng.integers(5, 16)) if blocks else rng.integers(0, 1000, n)
    operator = np.array(OPERATORS)[turns % len(OPERATORS)]
    objects = np.array(OBJECTS)[rng.integers(0, 2, n)]
    epochs = 2 if plan.exact else int(rng.integers(2, 4))
    epoch = np.arange(n) * epochs // n
    if plan.correlation:
        operator, objects = _together(plan, operator, objects, epoch)
    context = rng.integers(0, plan.contexts, n)
    wide = goal_half_width_m if plan.goal_half_width_m is None else plan.goal_half_width_m
    goal = wide * rng.uniform(-1.0, 1.0, n)
    mode, cue = _modes(plan, operator, objects, epoch, goal, rng)
    failure = rng.random(n) < FAILURE_SHARE * plan.by_chance
    if plan.failing:
        failure |= (mode == len(plan.shares) - 1) & (rng.random(n) < plan.failing)
    recovery = rng.random(n) < RECOVERY_SHARE * plan.by_chance
    recovery |= np.arange(n) >= n - plan.recoveries
    return Roster(
        operator=operator, object=objects, epoch=epoch, mode=mode, cue=cue, context=context,
        goal_lateral_m=goal, recovery=recovery, failure=failure,
        split=_splits(n, rng),
    )  # fmt: skip


def _together(plan, operator, objects, epoch):
    """Operators that come by epochs, each with an object of their own, in a share of episodes."""
    rng = stream(plan.seed, "correlation")
    by_epoch = rng.random(len(epoch)) < plan.correlation
    operator = np.where(by_epoch, np.array(OPERATORS)[epoch % len(OPERATORS)], operator)
    own = np.array(OBJECTS)[np.isin(operator, OPERATORS[1:2]).astype(int)]
    return operator, np.where(rng.random(len(epoch)) < plan.correlation, own, objects)


def _modes(plan, operator, objects, epoch, goal, rng):
    """Mode of each episode, and the mode that the decider stands for."""
    n, count = len(operator), len(plan.shares)
    free = rng.choice(count, size=n, p=np.array(plan.shares))
    if count == 1:
        return free, free
    number = np.arange(n)
    decided = {
        "chance": free,
        "operator": np.isin(operator, OPERATORS[1:2]).astype(int),
        "object": np.isin(objects, OBJECTS[1:]).astype(int),
        "calibration_epoch": epoch % 2,
        # Sessions of changing length: the operator is told a side, and keeps it for the session.
        "session": np.searchsorted(np.cumsum(rng.integers(10, 19, n)), number, side="right") % 2,
        "alternation": number % 2,
        "lamp_early": free,
        "path_early": free,
        "lamp": free,
        "habit": free,
        "drift": free,
        "goal": (goal > 0).astype(int),
    }[plan.decided_by]
    obeys = rng.random(n) < plan.fidelity
    cue = np.asarray(decided, dtype=np.int64)
    other = rng.choice(count, size=n, p=np.array(plan.shares))
    if plan.decided_by == "drift":
        share = 0.5 + plan.fidelity * (number / max(n - 1, 1) - 0.5)
        drawn = (rng.random(n) < share).astype(np.int64)
        return drawn, drawn
    if plan.decided_by == "habit":
        for at in range(1, n):
            cue[at] = other[at - 1]
            other[at] = cue[at] if obeys[at] else other[at]
        return other, cue
    return np.where(obeys, cue, other), cue


def _splits(n, rng):
    """60 % train, 20 % validation, 20 % test, in random order."""
    names = np.array(["train"] * 3 + ["validation", "test"])
    return rng.permutation(names[np.arange(n) % 5])
