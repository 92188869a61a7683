"""One change of a recording, and how several follow each other."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.audit_real.plan import Plan
from benchmarks.audit_real.recording import Episode, Recording

Make = Callable[[Plan], Recording]
# Changes are made in this order: what is done to the action's form before what goes wrong in it,
# names and the order of columns last.
MERGE, LAYOUT, FORM, COLUMNS, TIME, DEFECT, NAMES = range(7)


@dataclass(frozen=True)
class Place:
    """Where a change happens: how the base is made, and its draws.

    Attributes:
        make: Makes the base from a plan.
        plan: The plan that it was made from.
        rng: Draws of this change.
    """

    make: Make
    plan: Plan
    rng: np.random.Generator


@dataclass(frozen=True)
class Change:
    """A change of known truth.

    Attributes:
        name: What it is called.
        stage: When it is made, see above.
        apply: Makes it, of a strength.
        truth: What is true by it, a sentence.
        strengths: Strengths that are tried, in `unit`.
        unit: Of the strengths; empty where it has none.
        fits: Whether it makes sense of a base.
        plan: What it changes in the making of the base.
    """

    name: str
    stage: int
    apply: Callable[[Recording, Place, float], Recording]
    truth: str
    strengths: tuple[float, ...] = (1.0,)
    unit: str = ""
    fits: Callable[[Recording], bool] = lambda recording: True
    plan: Callable[[Plan, float], Plan] = lambda plan, strength: plan


def unchanged(recording: Recording, place: Place, strength: float) -> Recording:
    """The recording as it is."""
    return recording


def some(recording: Recording, place: Place, share: float) -> set[int]:
    """Places of a share of the episodes, at random."""
    count = len(recording.episodes)
    return set(place.rng.permutation(count)[: max(2, round(share * count))].tolist())


def at_places(
    recording: Recording, places: set[int], change: Callable[[Episode], Episode]
) -> Recording:
    """The recording with the episodes at these places changed, and marked as faulty."""
    episodes = tuple(
        replace(change(episode), faulty=True) if k in places else episode
        for k, episode in enumerate(recording.episodes)
    )
    return replace(recording, episodes=episodes)


def published(recording: Recording) -> bool:
    """Known by its arrays, with a contract of its own: columns and forms are as it states them."""
    return recording.real and recording.layout == "zarr"


def free(recording: Recording) -> bool:
    """Several ways, and nothing that decides them yet."""
    return recording.truth.modes > 1 and not recording.truth.decided_by


def steady(recording: Recording) -> bool:
    """Nobody changes the way within an episode."""
    return all(bool(np.all(e.mode == e.mode[0])) for e in recording.episodes)
