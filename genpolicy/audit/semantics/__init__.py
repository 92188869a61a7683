"""Data semantics: clocks, frames, units, continuity and calibration, before anything else."""

from genpolicy.audit.semantics.clocks import episode_lags
from genpolicy.audit.semantics.measure import measure
from genpolicy.audit.semantics.realign import realigned
from genpolicy.audit.semantics.report import Semantics

__all__ = [
    "Semantics", "episode_lags", "measure", "realigned",
]  # fmt: skip
