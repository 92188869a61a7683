"""The gain in each condition, and inside the envelope, which is all that a card allows.

The promotion test averages the conditions of a start, so that what is gained in one may be lost in
another. Each is told; one is asked: inside the envelope there must be a gain at all.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from gates.bounds import mean_gain
from gates.evidence import Array, Evidence
from gates.stress.pairs import paired_by_condition, paired_differences
from gates.stress.rollouts import ENVELOPE, StressSettings
from gates.words import points
from genpolicy.statistics.eprocess import gain_interval, paired_e_value

WORST = "worst in"
"""Before the name of the condition in which least is gained; the list of doubts reads it."""


@dataclass(frozen=True)
class Inside:
    """The least gain over a baseline inside the envelope.

    Attributes:
        baseline: Over which there is least evidence of a gain.
        differences: Of the pairs with it. Shape (starts,).
        alpha: Error of the test, and of each end of the interval.
        e_value: Evidence that there is a gain.
        shown: Whether one is shown, over every baseline.
        worse: Whether over this baseline it is shown to be a loss.
        measure: What is compared, success or utility.
    """

    baseline: str
    differences: Array = field(repr=False, compare=False)
    alpha: float
    e_value: float
    shown: bool
    worse: bool
    measure: str

    @property
    def gain(self) -> float:
        """Mean difference over the starts."""
        return mean_gain(self.differences)

    @property
    def starts(self) -> int:
        """Pairs."""
        return len(self.differences)

    @property
    def interval(self) -> tuple[float, float]:
        """Gains that the pairs do not speak against."""
        return gain_interval(self.differences, alpha=self.alpha)

    def __str__(self) -> str:
        low, high = self.interval
        return (
            f"inside the envelope {points(self.gain)} of {self.measure} over {self.baseline} on "
            f"{self.starts} starts, between {points(low)} and {points(high)}"
        )


@dataclass(frozen=True)
class Least:
    """The least evidence over the baselines that the gain exceeds the margin.

    Attributes:
        e_value: Over all conditions.
        baseline: Over which.
        gain: Mean difference over the starts.
        inside: The same question inside the envelope, for any gain; None where none is planned.
        measured: What is held against the limit; None where a gain is shown over all conditions
            and inside the envelope neither a gain nor a loss is.
    """

    e_value: float
    baseline: str
    gain: float
    inside: Inside | None
    measured: float | None


def by_condition(evidence: Evidence, settings: StressSettings, candidate: str) -> str:
    """The least mean gain over a baseline in each condition, the worst condition first.

    Raises:
        MissingEvidenceError: A condition has fewer starts in common than are planned.
    """
    least: dict[str, tuple[float, str]] = {}
    for baseline in settings.baselines:
        pairs = paired_by_condition(evidence, settings, candidate, baseline)
        for condition, found in pairs.items():
            gain = (mean_gain(found), baseline)
            least[condition] = min(least.get(condition, gain), gain)
    told = ", ".join(
        f"{condition} {points(gain)} over {baseline}"
        for (gain, baseline), condition in sorted((gain, name) for name, gain in least.items())
    )
    return (
        f"{settings.measure} on {settings.planned_starts} starts in each condition, {WORST} {told}"
    )


def in_success(evidence: Evidence, settings: StressSettings, candidate: str, baseline: str) -> str:
    """The gain in success alone over a baseline, where utility is what is compared."""
    alone = settings.model_copy(update={"utility": {}})
    differences = paired_differences(evidence, alone, candidate, baseline)
    low, high = gain_interval(differences, alpha=settings.alpha)
    gain = points(mean_gain(differences))
    return f"in success alone {gain} over {baseline}, between {points(low)} and {points(high)}"


def inside_envelope(evidence: Evidence, settings: StressSettings, candidate: str) -> Inside | None:
    """The gain inside the envelope over the baseline against which it is shown least.

    A negative margin asks there for no more than everywhere: that it is not worse by as much.

    Returns:
        None where no condition inside an envelope is planned.

    Raises:
        MissingEvidenceError: As `by_condition`.
    """
    if ENVELOPE not in settings.perturbations:
        return None
    return inside_pairs(
        {
            baseline: paired_by_condition(evidence, settings, candidate, baseline)[ENVELOPE]
            for baseline in settings.baselines
        },
        settings,
    )


def inside_pairs(differences: Mapping[str, Array], settings: StressSettings) -> Inside:
    """The same from the pairs inside the envelope, by baseline. Shape (starts,) each."""
    margin, alpha = min(0.0, settings.margin), settings.alpha
    tests = {
        baseline: paired_e_value(pairs, margin=margin, alpha=alpha)
        for baseline, pairs in differences.items()
    }
    baseline = min(tests, key=lambda name: (tests[name].e_value, differences[name].mean()))
    loss = paired_e_value(-differences[baseline], margin=-margin, alpha=alpha)
    shown = tests[baseline].e_value >= 1.0 / alpha
    return Inside(
        baseline=baseline,
        differences=differences[baseline],
        alpha=alpha,
        e_value=tests[baseline].e_value,
        shown=shown,
        worse=not shown and loss.decision == "promote",
        measure=settings.measure,
    )


def least_gain(
    differences: Mapping[str, Array], inside: Inside | None, settings: StressSettings
) -> Least:
    """The rule of promotion, from pairs: a gain over every baseline, and one inside the envelope.

    Args:
        differences: Candidate minus baseline over all conditions of a start, by baseline. Shape
            (starts,) each.
        inside: What is shown inside the envelope.
        settings: Margin and alpha.
    """
    e_value, baseline = min(
        (
            paired_e_value(pairs, margin=settings.margin, alpha=settings.alpha).e_value,
            baseline,
        )
        for baseline, pairs in differences.items()
    )
    measured: float | None = e_value
    if inside and e_value >= 1.0 / settings.alpha and not inside.shown:
        measured = inside.e_value if inside.worse else None
    return Least(e_value, baseline, mean_gain(differences[baseline]), inside, measured)
