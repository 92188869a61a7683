"""Between candidates that pass: is one shown to be better, or is it either of them?

Passing says that a candidate beats the simple policies; it does not order the candidates. The
order is a question of its own, with a paired test of its own. Where no test tells them apart the
decision says so, and which of them goes on the card follows from a rule fixed before the run: the
one whose answers come sooner, then the one registered first. Of several that are all unmatched no
rule may choose: a person does.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

from gates.bounds import mean_gain
from gates.claim import IN_SHORT
from gates.engine import Decision, Judged
from gates.evidence import Array, Evidence
from gates.stress.cost import latency_p95_s
from gates.stress.pairs import paired_differences
from gates.stress.rollouts import StressSettings
from gates.words import points
from genpolicy.statistics.eprocess import paired_e_value

PASSED_UNMATCHED = "also passed, unmatched and so not ranked"
CHOOSING = (
    "No card is drafted until one of them is left: take the exceptions of the others out of "
    "gate_b.unmatched in params.yaml, commit that with the reason, and run `dvc repro`."
)
"""How a person chooses where nobody may compare; who is left out stays in the plan, and counts."""


@dataclass(frozen=True)
class Comparison:
    """Evidence that one passing candidate is better than another.

    Attributes:
        better: The one.
        other: The other.
        e_value: Evidence that `better` is worth more on average, in what is compared.
        gain: Mean difference over the starts.
    """

    better: str
    other: str
    e_value: float
    gain: float


def choose(judged: Judged) -> Decision:
    """Whom to promote of those that passed, and whether it is one or either.

    Raises:
        MissingEvidenceError: Two that passed do not share their starts.
    """
    settings: StressSettings = judged.settings
    every = [name for name in settings.candidates if judged.candidates.get(name) == "PASS"]
    passed = [name for name in every if name not in settings.unmatched]
    if not passed:
        return _of_unmatched(every)
    if len(passed) < len(every):
        decision = _of_matched(passed, judged, settings)
        beside = ", ".join(name for name in every if name not in passed)
        text = f"{decision.text.removesuffix('.')}; {PASSED_UNMATCHED}: {beside}"
        return Decision(text, decision.promoted)
    return _of_matched(passed, judged, settings)


def _of_unmatched(passed: Sequence[str]) -> Decision:
    """The only one; of several that nobody may rank a person chooses, and none is drafted."""
    if len(passed) == 1:
        text = f"promote {passed[0]}, {IN_SHORT}, on unmatched evidence"
        return Decision(text, promoted=passed[0])
    return Decision(
        f"promote either of {', '.join(sorted(passed))}, {IN_SHORT}, on unmatched evidence: no "
        f"ranking may rest on it, so that a person chooses. {CHOOSING}"
    )


def _of_matched(passed: Sequence[str], judged: Judged, settings: StressSettings) -> Decision:
    if len(passed) == 1:
        return Decision(f"promote {passed[0]}, {IN_SHORT}", promoted=passed[0])
    return ranked(
        passed, comparisons(judged.evidence, settings, passed), settings, _latency(judged)
    )


def ranked(
    passed: Sequence[str],
    found: Sequence[Comparison],
    settings: StressSettings,
    latency_s: Mapping[str, float],
) -> Decision:
    """One or either of several that passed.

    Args:
        passed: Their names, as registered.
        found: Every ordered pair of them.
        settings: The family's error.
        latency_s: How soon the answers of each come, s.
    """
    needed = 1.0 / pair_alpha(settings)
    shown = [one for one in found if one.e_value >= needed]
    left = [name for name in passed if all(one.other != name for one in shown)] or passed
    for_the_card = sooner(left, latency_s)
    others = [name for name in passed if name not in left]
    better = f"; shown to be worse: {', '.join(others)}" if others else ""
    if len(left) == 1:
        return Decision(f"promote {for_the_card}, {IN_SHORT}{better}", promoted=for_the_card)
    most = max(
        (one for one in found if one.better in left and one.other in left),
        key=lambda one: one.e_value,
    )
    text = (
        f"promote either of {', '.join(left)}, {IN_SHORT}{better}: no paired test "
        f"tells them apart (evidence at most {most.e_value:.3g} to 1 that {most.better} is better "
        f"than {most.other}, where {needed:.3g} to 1 is needed; difference {points(most.gain)} of "
        f"{settings.measure}). The card is drafted for {for_the_card}, whose answers come sooner."
    )
    return Decision(text, promoted=for_the_card)


def pair_alpha(settings: StressSettings) -> float:
    """Error of one ordered pair; all pairs of those registered share that of the family."""
    registered = len(settings.candidates)
    return settings.family_alpha / max(1, registered * (registered - 1))


def comparisons(
    evidence: Evidence, settings: StressSettings, names: Sequence[str]
) -> list[Comparison]:
    """Every ordered pair of candidates, tested for any gain at all.

    Raises:
        MissingEvidenceError: Two do not share their starts.
    """
    found = []
    for better, other in permutations(names, 2):
        differences = paired_differences(evidence, settings, better, other)
        found.append(compared(better, other, differences, settings))
    return found


def compared(better: str, other: str, differences: Array, settings: StressSettings) -> Comparison:
    """One ordered pair: `better` minus `other` on each start. Shape (starts,)."""
    test = paired_e_value(differences, margin=0.0, alpha=pair_alpha(settings))
    return Comparison(better, other, test.e_value, mean_gain(differences))


def sooner(names: Sequence[str], latency_s: Mapping[str, float]) -> str:
    """The first of those whose answers come soonest; an unknown latency comes last."""
    return min(names, key=lambda name: latency_s.get(name, math.inf))


def _latency(judged: Judged) -> dict[str, float]:
    return {
        answer.candidate: answer.measured
        for answer in judged.answers
        if answer.id == latency_p95_s.id and answer.candidate and answer.measured is not None
    }
