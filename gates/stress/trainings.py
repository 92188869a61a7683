"""What a method is worth over its trainings: said beside the verdict, which is of one checkpoint.

Who is promoted is fixed before a rollout: the checkpoint of the first training seed, never the best
one. The further trainings run from the same starts, under the same conditions, and no criterion
reads them. From them follows what is claimed of the method: an interval over trainings and starts,
and how many of all its trainings would gain as much.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from gates.bounds import counted_interval, mean_gain
from gates.engine import Judged
from gates.evidence import Array, Evidence, MissingEvidenceError, flags
from gates.stress.rollouts import STRESS, StressSettings, rollouts
from gates.stress.utility import utilities
from gates.stress.weights import by_cost
from gates.words import percents, points, span, three
from genpolicy.contract.planner import PLANNER
from genpolicy.evidence.documents.stress import folder_of_seed
from genpolicy.statistics.crossed import Components, components, gain_of_methods, mean_interval

CLAIMED = "so that a gain is claimed of the method"
UNCLAIMED = "so that no gain is claimed of the method"
ROLLOUT = ["start", "perturbation"]


@dataclass(frozen=True)
class Trained:
    """A method over its trainings.

    Attributes:
        name: The method.
        seeds: Numbers of its training seeds, the one that is promoted first; one of what has no
            training here.
        worth: Of every rollout, in what is compared. Shape (trainings, starts, conditions).
        success: 1 where it succeeded, likewise.
    """

    name: str
    seeds: tuple[int, ...]
    worth: Array
    success: Array

    @property
    def by_start(self) -> Array:
        """What each training is worth on each start. Shape (trainings, starts)."""
        return np.asarray(self.worth.mean(axis=2), dtype=np.float64)

    @property
    def each(self) -> list[float]:
        """What each training is worth, in the order of the seeds."""
        return [float(value) for value in self.worth.mean(axis=(1, 2))]

    @property
    def scatter(self) -> float:
        """Standard deviation between what the trainings are worth."""
        return float(np.std(self.each, ddof=1))

    @property
    def components(self) -> Components:
        """Where what a rollout is worth comes from."""
        return components(self.worth)

    def mean(self, confidence: float, *, success: bool = False) -> tuple[float, float, float]:
        """Worth, or success, with its interval over trainings and starts, within 0 and 1."""
        values = (self.success if success else self.worth).mean(axis=2)
        alpha = (1.0 - confidence) / 2.0
        mean, low, high = mean_interval(values, alpha=alpha)
        return mean, *within(mean, low, high, starts=values.shape[1], alpha=alpha, least=0.0)


@dataclass(frozen=True)
class Gain:
    """The gain of a method over a simple one, over trainings of both and the starts they share.

    Attributes:
        baseline: The simple method.
        gain: Mean.
        low: Lower end of its interval.
        high: Upper end.
        of_each: Gain of each training over the mean of the simple method's.
    """

    baseline: str
    gain: float
    low: float
    high: float
    of_each: tuple[float, ...]


@dataclass(frozen=True)
class Claim:
    """What is claimed of a method.

    Attributes:
        trained: The method.
        gains: Over every simple method.
        margin: Gain to be shown.
    """

    trained: Trained
    gains: tuple[Gain, ...]
    margin: float

    @property
    def least(self) -> Gain:
        """The gain that is shown least."""
        return min(self.gains, key=lambda one: one.low)

    @property
    def made(self) -> bool:
        """Whether the gain over every simple method is shown to be larger than the margin."""
        return all(one.low > self.margin for one in self.gains)

    @property
    def above(self) -> int:
        """Trainings that gain more than the margin over every simple method."""
        worst = np.min([one.of_each for one in self.gains], axis=0)
        return int(np.sum(worst > self.margin))


def within(
    mean: float, low: float, high: float, *, starts: int, alpha: float, least: float
) -> tuple[float, float]:
    """Ends within what can be, and no nearer than what so many starts cannot have shown.

    Student's t has no width where all starts end alike. But a share of starts on which everything
    ends at the worst (or the best) stays unseen on all of them with probability `alpha`: exact.

    Args:
        mean: What lies between the ends.
        low: Lower end.
        high: Upper end.
        starts: How many were run.
        alpha: Probability with which either end is wrong, in (0, 1).
        least: The worst that a start can be worth; the best is 1.
    """
    unseen = 1.0 - alpha ** (1.0 / starts)
    low = min(low, mean - unseen * (mean - least))
    high = max(high, mean + unseen * (1.0 - mean))
    return max(least, low), min(1.0, high)


def path_of(seed: int, settings: StressSettings) -> str:
    """Folder of the rollouts of a training seed."""
    return STRESS if seed == settings.seeds[0] else f"{STRESS}/{folder_of_seed(seed)}"


def over_trainings(evidence: Evidence, settings: StressSettings, method: str) -> Trained:
    """A method over all trainings that are planned.

    Raises:
        MissingEvidenceError: A training lacks a condition or a start, has rows of another seed, or
            began elsewhere than the first; or as `utilities`.
    """
    weights = tuple(by_cost(settings.utility).items())
    planned = (settings.perturbations, settings.planned_starts, settings.seeds)
    key = ("trainings", method, *planned, weights, settings.longest_s)
    return evidence.once(key, lambda: _over_trainings(evidence, settings, method))


def _over_trainings(evidence: Evidence, settings: StressSettings, method: str) -> Trained:
    alone = method == PLANNER or method in settings.brought
    seeds = settings.seeds[:1] if alone else settings.seeds
    found = [_of_seed(evidence, settings, method, seed) for seed in seeds]
    for seed, rows in zip(seeds, found, strict=True):
        if not rows["start_sha256"].equals(found[0]["start_sha256"]):
            raise MissingEvidenceError(f"{method}: training {seed} began elsewhere than the first")
    shape = (len(seeds), settings.planned_starts, len(settings.perturbations))
    worth, success = (
        np.stack([rows[name].to_numpy(dtype=np.float64) for rows in found]).reshape(shape)
        for name in ("worth", "success")
    )
    return Trained(method, tuple(seeds), worth, success)


def _of_seed(evidence: Evidence, settings: StressSettings, method: str, seed: int) -> pd.DataFrame:
    """Rollouts of one training by start and condition, each once and in one order."""
    folder = path_of(seed, settings)
    rows = rollouts(evidence, settings, method, folder=folder)
    where = f"{method}, training {seed}"
    if set(rows["seed"]) != {seed}:
        raise MissingEvidenceError(f"{where}: {folder} has rows of another training")
    rows = rows.assign(
        worth=utilities(evidence, settings, method, rows, folder=folder),
        success=flags(rows, "success"),
    ).set_index(ROLLOUT)
    wanted = pd.MultiIndex.from_product(
        [range(settings.planned_starts), settings.perturbations], names=ROLLOUT
    )
    if rows.index.has_duplicates or not wanted.isin(rows.index).all():
        raise MissingEvidenceError(f"{where}: not every planned start once in every condition")
    return rows.loc[wanted]


def claim_of(evidence: Evidence, settings: StressSettings, candidate: str) -> Claim:
    """What the trainings of a candidate say of its method.

    Raises:
        MissingEvidenceError: As `over_trainings`.
    """
    own = over_trainings(evidence, settings, candidate)
    if len(own.seeds) < 2:
        raise MissingEvidenceError(f"of {candidate} one training is known here")
    gains = [
        _gain(own, over_trainings(evidence, settings, name), settings)
        for name in settings.baselines
    ]
    return Claim(own, tuple(gains), settings.margin)


def _gain(own: Trained, other: Trained, settings: StressSettings) -> Gain:
    gain, low, high = gain_of_methods(own.by_start, other.by_start, alpha=settings.alpha)
    low, high = within(
        gain, low, high, starts=own.by_start.shape[1], alpha=settings.alpha, least=-1.0
    )
    difference = own.by_start - other.by_start.mean(axis=0)
    of_each = tuple(mean_gain(row) for row in difference)
    return Gain(other.name, gain, low, high, of_each)


def trainings_said(judged: Judged) -> list[str]:
    """Of each candidate, what its trainings say of its method; silent where one was planned."""
    settings = judged.settings
    assert isinstance(settings, StressSettings)
    if not settings.further_seeds:
        return []
    said = []
    for name in judged.candidates:
        try:
            claim = claim_of(judged.evidence, settings, name)
        except MissingEvidenceError as error:
            said.append(f"This method, {name}: nothing is claimed of it ({error}).")
        else:
            said.append(_sentence(claim, settings))
    return said


def _sentence(claim: Claim, settings: StressSettings) -> str:
    own, least = claim.trained, claim.least
    mean, low, high = own.mean(settings.confidence)
    share = counted_interval(claim.above, len(own.seeds), confidence=settings.confidence)
    return (
        f"This method, {own.name}: {len(own.seeds)} trainings are worth "
        f"{', '.join(three(value) for value in own.each)} in {settings.measure} (seeds "
        f"{', '.join(map(str, own.seeds))}, on the same starts), on average {three(mean)} "
        f"({three(low)} to {three(high)}), with {three(100 * own.scatter)} points of standard "
        f"deviation between them. Its least gain, over {least.baseline}, is {points(least.gain)} "
        f"({span(points(least.low), points(least.high))} over trainings and starts, if trainings "
        f"scatter normally), margin {points(claim.margin)}, {CLAIMED if claim.made else UNCLAIMED}."
        f" {claim.above} of {len(own.seeds)} trainings gain more than the margin over every simple "
        f"method; without that assumption so would {percents(*share)} of all its trainings. A "
        f"rollout varies by {parts(own.components)}."
    )


def parts(found: Components) -> str:
    """Components of variance as standard deviations, in points."""
    each = (
        ("training", found.training), ("start", found.start), ("condition", found.condition),
        ("noise of the sampler and what these do together", found.rest),
    )  # fmt: skip
    return ", ".join(f"{three(100 * value)} points by {name}" for name, value in each)
