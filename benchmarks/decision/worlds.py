"""Worlds whose truth is known: success of simple methods and candidates, and how outcomes are tied.

Outcomes of one start are tied three ways: between methods (a hard start is hard for all), between
conditions (what fails undisturbed fails under a push), and by the training seed (a checkpoint is
better or worse than its method on every start).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
        baselines: True success of each simple method.
        candidates: True success of each candidate, over its method's training seeds.
        tilt: Added to the success of candidates, by condition.
        methods_alike: Share of outcomes that one draw decides for all methods.
        conditions_alike: Share of starts that end alike in all conditions.
        spread: Standard deviation of success between training seeds of a candidate.
        seeds: Checkpoints of a candidate that are run and averaged.
        registered: Candidates that share the family's alpha; each has its share of it.
        peeking: Starts after which the rule is asked again; 0: at the end only.
        most: The share that is counted may be at most this, at the worse end of its interval.
        least: At least this, likewise.
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


@dataclass(frozen=True)
class Drawn:
    """One trial.

    Attributes:
        baselines: Success of each simple method. Shape (methods, conditions, starts).
        candidates: Mean success over checkpoints. Shape (candidates, conditions, starts).
        truth: True success of these checkpoints. Shape (candidates, conditions).
        of_method: True success of their methods, likewise.
        simple: True success of the simple methods. Shape (methods, conditions).
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
    seeds = np.clip(of_method[:, None] + lucky[:, :, None], 0.0, 1.0)
    shares = np.concatenate([simple, seeds.reshape(-1, len(CONDITIONS))])
    won = outcomes(shares, starts, world.methods_alike, world.conditions_alike, rng)
    count = len(simple)
    own = won[count:].reshape(len(of_method), world.seeds, len(CONDITIONS), starts)
    return Drawn(won[:count], own.mean(axis=1), seeds.mean(axis=1), of_method, simple)


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
