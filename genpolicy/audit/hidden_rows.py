"""Rows of what may decide the modes unseen: tested, told, or never asked.

Read them from `genpolicy.audit.rows`, where all tables stand; this file imports nothing.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Stratum:
    """`strata.parquet`: one variable in one phase; None where the test was not run.

    Attributes:
        variable: Name of the variable; `channel.component` for an observed one.
        phase: Task phase.
        p_value: Permutation p-value.
        p_adjusted: After Holm over all variables and phases.
        effect: Share of the modes' entropy inside situations that it explains.
        effect_lower: Lower end of the interval.
        effect_upper: Upper end of the interval.
        n: Episodes that could tell.
        recorded: False where the variable was not recorded at all: it stays unknown.
        observed: Whether a policy sees it.
        detail: What of it, in words; empty where the name says all.
    """

    variable: str
    phase: str
    p_value: float | None
    p_adjusted: float | None
    effect: float | None
    effect_lower: float | None
    effect_upper: float | None
    n: int
    recorded: bool
    observed: bool
    detail: str = ""


@dataclass(frozen=True)
class Prediction:
    """`predictions.parquet`: what one variable tells of the modes of one phase.

    Attributes:
        variable: Name of the variable.
        phase: Task phase.
        told: Share of wrong guesses that it takes away on held-out episodes; of the past, of those
            that the present leaves.
        told_lower: Lower end of the interval.
        told_upper: Upper end of the interval.
        right: Share of right guesses, each episode weighted by how rare its mode is where it was.
        chance: The same of guesses without knowledge.
        n: Episodes that had a choice and the variable.
        detail: What of it, in words; empty where the name says all.
    """

    variable: str
    phase: str
    told: float
    told_lower: float
    told_upper: float
    right: float
    chance: float
    n: int
    detail: str = ""


@dataclass(frozen=True)
class Asked:
    """`asked.parquet`: one question, and whether it could be asked.

    Attributes:
        check: Name of the question, `name` or `name.of what`.
        asked: Whether it could be asked.
        reason: Why not; empty where it was.
    """

    check: str
    asked: bool
    reason: str
