"""Settings of Gate B, and where its evidence lies."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from pydantic import Field

from gates.evidence import Evidence, MissingEvidenceError, numbers
from gates.settings import CandidateSettings
from genpolicy.evidence.rows.reproducibility import NfeRow

RELOAD = "artifacts/reload"
COVERAGE = f"{RELOAD}/coverage.parquet"
MODES = f"{RELOAD}/modes.parquet"
MODES_EARLIER = f"{RELOAD}/modes_earlier.parquet"
DENSITY = f"{RELOAD}/density.parquet"
GENERATORS = "artifacts/train_generators"


class ReproducibilitySettings(CandidateSettings):
    """Settings of Gate B other than limits.

    Attributes:
        baselines: Simpler methods that candidates will be compared with.
        term_deadlines: Of each latency term, what it may take, s, and what is done beyond.
        budget_reference: Method whose parameter count is the budget.
        mode_minimum_share: Share of the samples of a situation that must be admissible and reach
            a mode, for that mode to be covered.
    """

    homes: ClassVar[Mapping[str, str]] = {
        **CandidateSettings.homes,
        "baselines": "stress.baselines",
        "term_deadlines": "execution.term_deadlines",
    }

    baselines: tuple[str, ...] = Field(min_length=1)
    term_deadlines: tuple[tuple[str, float, str], ...]
    budget_reference: str
    mode_minimum_share: float = Field(gt=0.0, le=0.5)


def chosen_nfe(evidence: Evidence, candidate: str) -> tuple[float, float]:
    """Fewest and most network evaluations that a sample of the candidate may take.

    Both are what it records, unless its sampler chooses its steps by itself: then what it takes
    differs with the observation, and the definition says from where to where.

    Raises:
        MissingEvidenceError: None, or several of a sampler that always takes the same.
    """
    rows = evidence.of(f"{RELOAD}/nfe.parquet", NfeRow, candidate)
    recorded, least, most = (numbers(rows, name) for name in ("recorded", "least", "most"))
    if np.all(least < most):
        return float(least.min()), float(most.max())
    lowest, highest = float(recorded.min()), float(recorded.max())
    if lowest != highest:
        raise MissingEvidenceError(f"{candidate} records several NFE: {lowest:g} to {highest:g}")
    return lowest, highest
