"""What blocks of starts save at Gate D, by simulated trials: how far candidates run."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gates.stress.rollouts import StressSettings
from genpolicy.evidence.stress.power import POWER_CORRELATION
from genpolicy.seeds import stream
from genpolicy.statistics.possible import Seen, first_out

TRIALS = 400
"""Simulated trials of one world."""
BEST, OWN = "best", "candidate"


@dataclass(frozen=True)
class Saved:
    """How far a candidate runs that is worth so much.

    Attributes:
        what: Which candidate, in words.
        candidate_success: Its success; that of the best simple method is that of the stated effect.
        ran_share: Mean share of the planned starts that it runs.
        stopped_share: Share of the trials in which it is stopped.
    """

    what: str
    candidate_success: float
    ran_share: float
    stopped_share: float


def saved_by_blocks(settings: StressSettings) -> tuple[Saved, ...]:
    """What the planned blocks save, against one simple method; empty where there are none.

    A start is one draw, as if its conditions ended alike. Nobody is stopped by a count of what is
    bad: nothing of the kind is simulated.

    Args:
        settings: Of Gate D, with its limits.
    """
    baseline, good = settings.planned_effect
    worlds = (
        ("without a gain", baseline),
        ("at the margin", min(1.0, baseline + settings.margin)),
        ("of the stated effect", good),
    )
    return tuple(
        Saved(what, success, *_ran(settings, baseline, success))
        for what, success in worlds
        if settings.rule is not None
    )


def _ran(settings: StressSettings, baseline: float, candidate: float) -> tuple[float, float]:
    """Mean share of the starts that are run, and share of trials in which it is stopped."""
    assert settings.rule is not None
    rule, shape = replace(settings.rule, simple=(BEST,)), (TRIALS, settings.planned_starts)
    # The same draws in each world, so that who is worth more runs as far or farther.
    rng = stream(settings.root_seed, "plan", "blocks")
    own = rng.random(shape)
    other = np.where(rng.random(shape) < POWER_CORRELATION, own, rng.random(shape))
    ends = []
    for won, lost in zip(own < candidate, other < baseline, strict=True):
        seen = {OWN: _seen(won, len(rule.conditions)), BEST: _seen(lost, len(rule.conditions))}
        out = first_out(rule, seen, OWN)
        ends.append(rule.starts if out is None else out[0])
    ran = np.array(ends)
    return float(ran.mean() / rule.starts), float((ran < rule.starts).mean())


def _seen(success: NDArray[np.bool_], conditions: int) -> Seen:
    alike = np.tile(success, (conditions, 1))
    return Seen(alike, np.zeros_like(alike), np.zeros_like(alike))
