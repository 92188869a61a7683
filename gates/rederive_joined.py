"""Chunks that were joined, held against samples that were drawn again: choices, means, prefixes.

Who had a say in a chunk is derived from the journal (`genpolicy.verification.rejoined`). Here the
checkpoint says what they said, and the settings of the plan by how much each counts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gates.report import Gate
from gates.stated import refuse
from genpolicy.candidates.joining import JoiningSettings
from genpolicy.contract.action import ACTION_DIM
from genpolicy.policies.prefix import Prefix
from genpolicy.verification.drawn import Drawn
from genpolicy.verification.rejoined import Made, Said, goes_on_from, mean_of, ways_to_plan

Array = NDArray[np.float64]

MEAN_TOLERANCE = 3e-5
"""Of a number of a blend, m or without unit. Each sample may be 1e-5 beside what was drawn, and so
may a mean of them; making two columns orthonormal again moves a number by up to three times that.
"""
WAY_TOLERANCE_M = 1e-4
"""Of a way from a plan, m: samples that are 1e-5 beside in 80 numbers are so much further away."""


@dataclass(frozen=True)
class Rule:
    """How the chunks of a method join.

    Attributes:
        joining: The rule, with its weights.
        rows: Actions of a chunk.
    """

    joining: JoiningSettings
    rows: int


def prefixes_of(asked: Sequence[Made | None], rule: Rule) -> Prefix | None:
    """What invocations were drawn to go on from; None where none of them was.

    Args:
        asked: What a candidate of each was made of; None where an earlier plan had no say.
        rule: Rule of their method.
    """
    if not any(asked):
        return None
    free = np.zeros((rule.rows, ACTION_DIM)), np.zeros(rule.rows)
    given = [free if made is None else goes_on_from(made, rule.rows) for made in asked]
    actions, weights = (np.stack(parts) for parts in zip(*given, strict=True))
    return Prefix(actions, weights, rule.joining.guidance, rule.joining.starts_at)


def hold_joined(
    gate: Gate,
    place: str,
    item: Drawn,
    *,
    own: Array,
    earlier: Mapping[str, Array],
    joining: JoiningSettings,
) -> None:
    """Hold the choice of a sample, and the mean that was made of it, against what was drawn again.

    Args:
        gate: Whose evidence it is.
        place: Where the candidate stands, in words.
        item: The candidate.
        own: Samples of its invocation, drawn again. Shape (N, K, 10).
        earlier: The same of those who had a say in it, by invocation.
        joining: The rule of its method.

    Raises:
        RefusedError: Another sample was due, or the blend is another mean.
    """
    made = item.made
    if made is None or not made.said:
        return
    if made.chosen:
        ways_m = ways_to_plan(made, own, joining.decay)
        due_m = np.sort(ways_m)[made.turn] if 0 <= made.turn < len(ways_m) else np.nan
        if not np.isclose(ways_m[made.draw], due_m, rtol=0.0, atol=WAY_TOLERANCE_M):
            found = f"is sample {made.draw}, {ways_m[made.draw]:.4g} m from the plan before"
            refuse(gate, place, found, f"the one {due_m:.4g} m from it, whose turn it is")
    if item.blended is not None:
        said = {one.invocation: _sample(gate, place, one, earlier) for one in made.said}
        again = mean_of(
            made, own[made.draw], said, decay=joining.decay, newest=joining.newest
        )  # fmt: skip
        if again.shape != item.blended.shape or not np.allclose(
            again, item.blended, rtol=0.0, atol=MEAN_TOLERANCE
        ):
            apart = np.max(np.abs(again - item.blended)) if again.shape == item.blended.shape else 0
            found = f"a blend up to {apart:.3g} beside it" if apart else "a blend of another shape"
            limit = f"the mean by {made.rule} of what is drawn there, within {MEAN_TOLERANCE:g}"
            refuse(gate, place, found, limit)


def _sample(gate: Gate, place: str, one: Said, earlier: Mapping[str, Array]) -> Array:
    samples = earlier[one.invocation]
    if not 0 <= one.draw < len(samples):
        refuse(gate, place, f"rests on sample {one.draw}", f"one of {len(samples)}")
    found: Array = samples[one.draw]
    return found
