"""The gain in each condition, and inside the envelope, which is all that a card allows.

The promotion test averages the conditions of a start, so that what is gained in one may be lost in
another. Each is told; one is asked: inside the envelope there must be a gain at all.
"""

from dataclasses import dataclass

from gates.evidence import Evidence
from gates.stress.pairs import paired_by_condition
from gates.stress.rollouts import ENVELOPE, StressSettings
from genpolicy.statistics.eprocess import gain_interval, paired_e_value

WORST = "worst in"
"""Before the name of the condition in which least is gained; the list of doubts reads it."""


@dataclass(frozen=True)
class Inside:
    """The least gain over a baseline inside the envelope.

    Attributes:
        baseline: Over which there is least evidence of a gain.
        gain: Mean difference over the starts.
        interval: Gains that the pairs do not speak against.
        starts: Pairs.
        e_value: Evidence that there is a gain.
        shown: Whether one is shown, over every baseline.
        worse: Whether over this baseline it is shown to be a loss.
    """

    baseline: str
    gain: float
    interval: tuple[float, float]
    starts: int
    e_value: float
    shown: bool
    worse: bool

    def __str__(self) -> str:
        low, high = self.interval
        return (
            f"inside the envelope {self.gain:+.4g} over {self.baseline} on {self.starts} starts, "
            f"between {low:+.3g} and {high:+.3g}"
        )


def by_condition(evidence: Evidence, settings: StressSettings, candidate: str) -> str:
    """The least mean gain over a baseline in each condition, the worst condition first.

    Raises:
        MissingEvidenceError: A condition has fewer starts in common than are planned.
    """
    least: dict[str, tuple[float, str]] = {}
    for baseline in settings.baselines:
        pairs = paired_by_condition(evidence, settings, candidate, baseline)
        for condition, found in pairs.items():
            # Rounded, since a mean over seeds that is nothing may come out as -1e-18.
            gain = (round(float(found.mean()), 12) + 0.0, baseline)
            least[condition] = min(least.get(condition, gain), gain)
    told = ", ".join(
        f"{condition} {gain:+.4g} over {baseline}"
        for (gain, baseline), condition in sorted((gain, name) for name, gain in least.items())
    )
    return f"on {settings.planned_starts} starts in each condition, {WORST} {told}"


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
    margin, alpha = min(0.0, settings.margin), settings.alpha
    found = []
    for baseline in settings.baselines:
        pairs = paired_by_condition(evidence, settings, candidate, baseline)[ENVELOPE]
        test = paired_e_value(pairs, margin=margin, alpha=alpha)
        found.append((test.e_value, baseline, pairs))
    value, baseline, pairs = min(found, key=lambda one: (one[0], one[2].mean()))
    loss = paired_e_value(-pairs, margin=-margin, alpha=alpha)
    shown = value >= 1.0 / alpha
    return Inside(
        baseline=baseline,
        gain=float(pairs.mean()),
        interval=gain_interval(pairs, alpha=alpha),
        starts=len(pairs),
        e_value=value,
        shown=shown,
        worse=not shown and loss.decision == "promote",
    )
