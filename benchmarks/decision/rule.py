"""The rule of promotion and of choice, Gate D's own functions, asked of one trial's pairs.

The functions are those that the gate calls with pairs of its tables (`least_gain`, `inside_pairs`,
`compared`, `ranked`); `whole.py` asks the gate itself, tables and all, and both must agree.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from benchmarks.decision.worlds import CONDITIONS, Array, Drawn, World
from gates.stress.choice import compared, ranked
from gates.stress.gains import inside_pairs, least_gain
from gates.stress.rollouts import StressSettings
from gates.verdicts import judge_criterion, rounded

ENVELOPE = CONDITIONS.index("envelope")
COUNTS = {
    "false": "promoted, gain of the checkpoints at most the margin",
    "false_of_method": "promoted, gain of their method at most the margin",
    "false_inside": "promoted, no gain inside the envelope",
    "promoted": "promoted",
    "worse": "named alone, another one truly better by 5 points",
    "either": "either of several",
}
ENOUGH_BETTER = 0.05


@dataclass(frozen=True)
class Told:
    """What the rule said of one trial.

    Attributes:
        verdicts: Of the promotion criterion, by candidate.
        chosen: Who is promoted; empty where nobody is.
        alone: Whether one is named, and not either of several.
    """

    verdicts: tuple[str, ...]
    chosen: str = ""
    alone: bool = False


def names(world: World) -> tuple[str, ...]:
    """Names of its candidates."""
    return tuple(f"candidate_{number}" for number in range(len(world.candidates)))


def told(drawn: Drawn, settings: StressSettings, peeking: int = 0) -> Told:
    """What the rule says; with peeking it is asked at every look, and the first pass ends it.

    As the rule stands a peeker is told nothing else: the evidence is its highest so far. What is
    asked here is that it stays so, by looks at the rollouts so far and not by that argument.
    """
    starts = drawn.baselines.shape[2]
    looks = (*range(peeking, starts, peeking), starts) if peeking else (starts,)
    passed = [_promotion(drawn, number, looks, settings) for number in range(len(drawn.candidates))]
    through = [
        name for name, verdict in zip(settings.candidates, passed, strict=True) if verdict == "PASS"
    ]
    if not through:
        return Told(tuple(passed))
    if len(through) == 1:
        return Told(tuple(passed), through[0], alone=True)
    means = drawn.candidates.mean(axis=1)
    index = {name: number for number, name in enumerate(settings.candidates)}
    found = [
        compared(better, other, means[index[better]] - means[index[other]], settings)
        for better, other in permutations(through, 2)
    ]
    decision = ranked(through, found, settings, {})
    assert decision.promoted is not None, "somebody passed"
    return Told(tuple(passed), decision.promoted, alone="either" not in decision.text)


def _promotion(drawn: Drawn, number: int, looks: tuple[int, ...], settings: StressSettings) -> str:
    """The first look at which it passes ends the trial, as an e-process allows; else the last."""
    verdict = "INCONCLUSIVE"
    for look in looks:
        own = drawn.candidates[number, :, :look]
        pairs = {
            name: own - drawn.baselines[place, :, :look]
            for place, name in enumerate(settings.baselines)
        }
        inside = inside_pairs({name: of[ENVELOPE] for name, of in pairs.items()}, settings)
        means: Mapping[str, Array] = {name: of.mean(axis=0) for name, of in pairs.items()}
        measured = least_gain(means, inside, settings).measured
        value = None if measured is None else rounded(measured)
        verdict = judge_criterion(value, rounded(1.0 / settings.alpha), ">=")
        if verdict == "PASS":
            break
    return verdict


def counted(
    asks: str, drawn: Drawn, found: Told, margin: float, candidates: tuple[str, ...]
) -> bool:
    """Whether the trial is one of those that are counted."""
    passed = [place for place, verdict in enumerate(found.verdicts) if verdict == "PASS"]
    best = drawn.simple.mean(axis=1).max()
    truth = drawn.of_method if asks == "false_of_method" else drawn.truth
    gains = truth.mean(axis=1) - best
    if asks in ("false", "false_of_method"):
        return any(gains[place] <= margin + 1e-9 for place in passed)
    if asks == "false_inside":
        inside = drawn.truth[:, ENVELOPE] - drawn.simple[:, ENVELOPE].max()
        return any(inside[place] <= 1e-9 for place in passed)
    if asks == "promoted":
        return bool(passed)
    if asks == "either":
        return len(passed) > 1 and not found.alone
    if not found.alone:
        return False
    own = gains[candidates.index(found.chosen)]
    return bool(np.any(gains >= own + ENOUGH_BETTER - 1e-9))
