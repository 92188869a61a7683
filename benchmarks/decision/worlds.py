"""Worlds whose truth is known: success of simple methods and candidates, and how outcomes are tied.

Outcomes of one start are tied three ways: between methods (a hard start is hard for all), between
conditions (what fails undisturbed fails under a push), and by the training seed (a checkpoint is
better or worse than its method on every start).

Outcomes may be graded: a success keeps all of its worth, or the least that weights must leave it.
These two ends are the widest that successes of a given mean can be, and so the hardest to judge by.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gates.stress.weights import LEAST_OF_A_SUCCESS

Array = NDArray[np.float64]
CONDITIONS = (
    "nominal", "camera_delay", "compute_contention", "network_jitter", "queue_reorder", "push",
    "recovery_drill", "envelope",
)  # fmt: skip
"""Of the shipped plan; the last is the one that a card allows."""


@dataclass(frozen=True)
class World:
    """What is true, and how many trials are drawn of it.

    Attributes:
        name: Short name; also that of its random stream.
        what: In words, for the table.
        asks: What is counted, keys of `rule.COUNTS`; `most` and `least` are about the first.
        baselines: True success of each simple method; its utility where outcomes are graded.
        candidates: The same of each candidate, over its method's training seeds.
        tilt: Added to that of candidates, by condition.
        methods_alike: Share of outcomes that one draw decides for all methods.
        conditions_alike: Share of starts that end alike in all conditions.
        spread: Standard deviation of success between training seeds of a candidate.
        seeds: Checkpoints of a candidate that are run and averaged.
        registered: Candidates that share the family's alpha; each has its share of it.
        peeking: Starts after which the rule is asked again; 0: at the end only.
        most: The share that is counted may be at most this, at the worse end of its interval.
        least: At least this, likewise.
        lost: Share of its worth that a success of a simple method loses to costs on average, and
            one of a candidate; none: success is compared.
    """

    name: str
    what: str
    asks: tuple[str, ...]
    baselines: tuple[float, ...]
    candidates: tuple[float, ...]
    tilt: tuple[tuple[str, float], ...] = ()
    methods_alike: float = 0.3
    conditions_alike: float = 0.5
    spread: float = 0.0
    seeds: int = 1
    registered: int = 3
    peeking: int = 0
    most: float | None = None
    least: float | None = None
    lost: tuple[float, float] | None = None


@dataclass(frozen=True)
class Drawn:
    """One trial.

    Attributes:
        baselines: Success of each simple method, or utility. Shape (methods, conditions, starts).
        candidates: Mean over checkpoints. Shape (candidates, conditions, starts).
        truth: True mean of these checkpoints. Shape (candidates, conditions).
        of_method: True mean of their methods, likewise.
        simple: True mean of the simple methods. Shape (methods, conditions).
    """

    baselines: Array
    candidates: Array
    truth: Array
    of_method: Array
    simple: Array


def draw(world: World, starts: int, rng: np.random.Generator) -> Drawn:
    """One trial of a world."""
    tilt = dict(world.tilt)
    tilts = np.array([tilt.get(name, 0.0) for name in CONDITIONS])
    simple = np.tile(np.array(world.baselines)[:, None], len(CONDITIONS))
    of_method = np.clip(np.array(world.candidates)[:, None] + tilts, 0.0, 1.0)
    lucky = world.spread * rng.standard_normal((len(world.candidates), world.seeds))
    most = 1.0 - (world.lost[1] if world.lost else 0.0)
    seeds = np.clip(of_method[:, None] + lucky[:, :, None], 0.0, most)
    shares = np.concatenate([simple, seeds.reshape(-1, len(CONDITIONS))])
    count = len(simple)
    if world.lost is None:
        won = outcomes(shares, starts, world.methods_alike, world.conditions_alike, rng)
    else:
        lost = np.repeat(world.lost, [count, len(shares) - count])[:, None]
        won = graded(shares, lost, starts, world, rng)
    own = won[count:].reshape(len(of_method), world.seeds, len(CONDITIONS), starts)
    return Drawn(won[:count], own.mean(axis=1), seeds.mean(axis=1), of_method, simple)


def graded(worth: Array, lost: Array, starts: int, world: World, rng: np.random.Generator) -> Array:
    """Utilities of each method: 0, or a success that costs nothing or all that it can.

    Args:
        worth: True utility. Shape (methods, conditions).
        lost: Share of its worth that a success loses on average. Shape (methods, 1).
        starts: How many.
        world: How successes are tied, and costs likewise.
        rng: Its generator.

    Returns:
        Shape (methods, conditions, starts).
    """
    most = 1.0 - LEAST_OF_A_SUCCESS
    alike = (starts, world.methods_alike, world.conditions_alike, rng)
    won = outcomes(worth / (1.0 - lost), *alike)
    dear = outcomes(np.broadcast_to(lost / most, worth.shape), *alike)
    return won * (1.0 - most * dear)


def outcomes(
    shares: Array, starts: int, methods_alike: float, conditions_alike: float,
    rng: np.random.Generator,
) -> Array:  # fmt: skip
    """Successes, 0 or 1, of each method in each condition on each start.

    Args:
        shares: True success. Shape (methods, conditions).
        starts: How many.
        methods_alike: As of `World`.
        conditions_alike: As of `World`.
        rng: Its generator.

    Returns:
        Shape (methods, conditions, starts).
    """
    methods, conditions = shares.shape
    alike = rng.random(starts) < conditions_alike
    common = np.where(alike, rng.random(starts), rng.random((conditions, starts)))
    own = np.where(
        alike, rng.random((methods, 1, starts)), rng.random((methods, conditions, starts))
    )
    tied = rng.random((conditions, starts)) < methods_alike
    # A start that ends alike in all conditions is tied between methods in all of them or in none.
    tied = np.where(alike, tied[0], tied)
    difficulty = np.where(tied, common, own)
    return (difficulty < shares[:, :, None]).astype(np.float64)
