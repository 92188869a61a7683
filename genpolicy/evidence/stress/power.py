"""Which verdicts the pre-registered test can reach, from the settings alone.

Apart from the tables: who plans needs neither a simulator nor a policy.
"""

from genpolicy.evidence.documents.stress import Power
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.seeds import stream
from genpolicy.statistics.eprocess import power_table

POWER_CORRELATION = 0.3
POWER_TRIALS = 4000


def power_document(settings: StressSettings, *, candidates: int, root_seed: int) -> Power:
    """Which verdicts the pre-registered test can reach; content of `power.json`.

    Args:
        settings: Section `stress`.
        candidates: How many were pre-registered; alpha is shared between them.
        root_seed: Root seed.
    """
    alpha = settings.alpha_of_each(candidates)
    rows = power_table(
        power_worlds(settings),
        margin=settings.margin,
        alpha=alpha,
        pairs=settings.starts,
        correlation=POWER_CORRELATION,
        trials=POWER_TRIALS,
        rng=stream(root_seed, "stress", "power"),
    )
    return Power(margin=settings.margin, alpha=alpha, pairs=settings.starts, rows=rows)


def power_worlds(settings: StressSettings) -> list[tuple[float, float]]:
    """Worlds of the power table, baseline and candidate: no gain, just the margin, and more.

    A start is one draw, as if all its conditions ended alike: the world with most noise.
    """
    baseline, margin = settings.planned_effect[0], settings.margin
    lowest = min(max(baseline, -margin), 1.0 - margin)  # so that both are shares
    worlds = [(baseline, baseline), (0.9, 0.9), (lowest, lowest + margin), settings.planned_effect]
    return list(dict.fromkeys([*worlds, (0.3, 0.9), (0.1, 0.9)]))
