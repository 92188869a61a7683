"""Splices: how an admitted chunk meets what was commanded before, as proposed and as projected."""

import math
from dataclasses import dataclass

import numpy as np

from genpolicy.contract.action import POSITION
from genpolicy.contract.chunk import Projected
from genpolicy.evidence.stress.state import InFlight
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker


@dataclass(frozen=True)
class Splice:
    """One splice; see `SpliceRow`.

    Attributes:
        invocation: Number of the invocation in its rollout.
        parents: Earlier predictions that had a say.
        raw_jump_m: Way from the last command to the first row that is due, as proposed, m.
        raw_jerk_m_s3: Largest jerk of the TCP over the boundary, as proposed, m/s^3; None where
            too little was commanded before.
        jump_m: The same way, as admitted, m.
        jerk_m_s3: The same jerk, as admitted, m/s^3.
    """

    invocation: int
    parents: int
    raw_jump_m: float
    raw_jerk_m_s3: float | None
    jump_m: float
    jerk_m_s3: float | None


def splice_of(checker: FeasibilityChecker, flying: InFlight, admitted: Admitted) -> Splice:
    """How a chunk that has just been admitted begins."""
    proposal = admitted.projected.proposal
    raw = Projected(proposal, proposal.actions, 0.0, 0.0)
    (raw_m, raw_jerk), (jump_m, jerk) = (
        _boundary(checker, chunk, admitted) for chunk in (raw, admitted.projected)
    )
    return Splice(flying.number, len(flying.votes), raw_m, raw_jerk, jump_m, jerk)


def _boundary(
    checker: FeasibilityChecker, chunk: Projected, admitted: Admitted
) -> tuple[float, float | None]:
    context = admitted.context
    first = chunk.actions[context.rows(len(chunk.actions))][0]
    jump_m = float(np.linalg.norm(first[POSITION] - context.last_action[POSITION]))
    jerk = checker.boundary_jerk_m_s3(chunk, context=context)
    return jump_m, jerk if math.isfinite(jerk) else None
