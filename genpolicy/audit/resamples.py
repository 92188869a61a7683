"""How stable are the numbers? The audit's measures on resampled data, one row for each draw.

Held-out episodes are drawn again with replacement, labels and outcomes again from their measured
shares, effects and p-values again from their sampling distributions. The rows are evidence; which
cause each of them names, and so how often it is the same, is judged where the limits are.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from genpolicy.audit.data import Array, Integers
from genpolicy.audit.documents import Counts, Persistence
from genpolicy.audit.labels import Replayed, disagreement
from genpolicy.audit.persistence import NULL_QUANTILE, persistent
from genpolicy.audit.reach_rows import StructureDraw
from genpolicy.audit.rows import ModeOutcome, Prediction, Resample, Stratum
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.situations import Claim, Situation, claims_of, coherent_phases
from genpolicy.audit.structure_draws import Queries, structure_draw
from genpolicy.seeds import stream
from genpolicy.statistics.intervals import clopper_pearson

TWO_SIDED_95, TWO_SIDED_90 = 1.96, 1.645


@dataclass(frozen=True)
class Measures:
    """What is drawn again; all else stays as it was measured.

    Attributes:
        replayed: Labels and replays.
        persistence: Identity over time.
        strata: Tests of variables, in the order of `strata.parquet`.
        told: What variables tell of the modes, in the order of `predictions.parquet`.
        modes: Modes of the phase with most situations, in the order of `modes.parquet`.
        counts: Support and structure.
        halves: Halves of the episodes whose data semantics were measured again.
    """

    replayed: tuple[Replayed, ...]
    persistence: Persistence
    strata: tuple[Stratum, ...]
    told: tuple[Prediction, ...]
    modes: tuple[ModeOutcome, ...]
    counts: Counts
    halves: int = 0


@dataclass(frozen=True)
class Table:
    """Situations as arrays, to draw episodes from.

    Attributes:
        queries: Every query, and the held-out episodes to draw.
        place: Position among those episodes of each situation. Shape (n,).
        phases: Phase of each situation. Length n.
        claims: What speaks for the modes of those claimed, before phases were held to persist.
        claimed: Several clusters claimed as modes, per situation. Shape (n,).
        persists: The same, and they persist. Shape (n,).
        identity: Situation, identity kept, and its null, of those measured.
    """

    queries: Queries
    place: Integers
    phases: list[str]
    claims: list[Claim]
    claimed: Array
    persists: Array
    identity: tuple[Integers, Array, Array]


def resamples(
    settings: AuditSettings,
    measured: Measures,
    situations: tuple[Situation, ...],
    queries: Queries,
    *,
    root_seed: int,
) -> tuple[tuple[Resample, ...], tuple[StructureDraw, ...]]:
    """Measures of resampled data, `settings.resamples` of them.

    Args:
        settings: Number of draws, and what makes modes persist.
        measured: What was measured.
        situations: Every analysed situation, before phases were held to persist.
        queries: Every query behind them.
        root_seed: Seed of the draws.
    """
    rng = stream(root_seed, "audit", "confidence")
    table = _table(situations, queries)
    pairs: list[tuple[Resample, StructureDraw]] = []
    for number in range(settings.resamples):
        row, times, kept, successes = _draw(settings, measured, table, rng)
        half = number % measured.halves if measured.halves else -1
        drawn = structure_draw(
            queries, times, kept, measured=measured.counts, findings=half, successes=successes
        )
        pairs.append((row, drawn))
    return tuple(row for row, _ in pairs), tuple(drawn for _, drawn in pairs)


def _table(situations: tuple[Situation, ...], queries: Queries) -> Table:
    known = [(n, item.identity) for n, item in enumerate(situations) if item.identity is not None]
    return Table(
        queries=queries,
        place=queries.place[: len(situations)],
        phases=[item.phase for item in situations],
        claims=claims_of(situations),
        claimed=np.array([item.two_mode for item in situations], dtype=np.float64),
        persists=np.array([persistent(item.identity) for item in situations], dtype=np.float64),
        identity=(
            np.array([n for n, _ in known], dtype=np.int64),
            np.array([value[0] for _, value in known]),
            np.stack([value[1] for _, value in known]) if known else np.zeros((0, 1)),
        ),
    )


def _draw(
    settings: AuditSettings, measured: Measures, table: Table, rng: np.random.Generator
) -> tuple[Resample, Integers, Array, tuple[int, ...]]:
    """One draw, how often it has each episode, which situations keep modes, and successes."""
    count = len(table.queries.episodes)
    times = np.bincount(rng.integers(0, max(count, 1), count), minlength=count)
    weights = times[table.place].astype(np.float64)
    good = coherent_phases(settings, table.claims, weights)
    kept = table.claimed * np.array([phase in good for phase in table.phases])
    two_mode = np.bincount(table.place, weights=kept, minlength=len(times)) > 0
    wrong, replays = disagreement(_replayed(measured.replayed, rng))
    identity = _persistence(measured.persistence, table, weights * kept)
    strata = [_stratum(row, rng) for row in measured.strata]
    modes = [_mode(mode, rng) for mode in measured.modes]
    told = [_told(row, rng) for row in measured.told]
    row = Resample(
        disagreements=wrong,
        disagreement_upper=_ends(wrong, replays)[1],
        two_mode=int(np.sum(weights * kept)),
        two_mode_episodes=int(np.sum(times * two_mode)),
        incoherent=int(np.sum(weights * (table.claimed - kept))),
        persistent=int(np.sum(weights * kept * table.persists)),
        kept=identity.observed,
        kept_null_q95=identity.null_q95,
        kept_n=identity.n,
        p_adjusted=tuple(row[0] for row in strata),
        effect=tuple(row[1] for row in strata),
        effect_lower=tuple(row[2] for row in strata),
        told=tuple(told),
        success_lower=tuple(
            _ends(drawn, mode.episodes)[0]
            for (drawn, _), mode in zip(modes, measured.modes, strict=True)
        ),
        admissible=tuple(mode[1] for mode in modes),
    )
    return row, times, kept, tuple(mode[0] for mode in modes)


def _ends(count: int, total: int) -> tuple[float, float]:
    """Ends at 95 % for a reader of the table; who judges bounds the counts."""
    return clopper_pearson(count, total)


def _persistence(measured: Persistence, table: Table, weight: Array) -> Persistence:
    numbers, shares, null = table.identity
    if len(numbers) == 0:
        return measured
    weights = weight[numbers]
    if weights.sum() <= 0.0:
        return Persistence(measured.observed, measured.null_q95, measured.null_mean, 0)
    expected = weights @ null / weights.sum()
    return Persistence(
        observed=float(np.average(shares, weights=weights)),
        null_q95=float(np.quantile(expected, NULL_QUANTILE)),
        null_mean=float(expected.mean()),
        n=int(weights.sum()),
    )


def _replayed(replayed: tuple[Replayed, ...], rng: np.random.Generator) -> tuple[Replayed, ...]:
    return tuple(replayed[k] for k in rng.integers(0, len(replayed), len(replayed)))


def _stratum(
    row: Stratum, rng: np.random.Generator
) -> tuple[float | None, float | None, float | None]:
    """Adjusted p-value, effect and its lower end, drawn from their sampling distributions."""
    if row.p_adjusted is None or row.effect is None:
        return row.p_adjusted, row.effect, row.effect_lower
    wide = (row.effect_upper or 0.0) - (row.effect_lower or 0.0)
    shock = float(rng.normal())
    effect = min(1.0, max(0.0, row.effect + shock * wide / (2 * TWO_SIDED_95)))
    p_value = float(ndtr(ndtri(min(max(row.p_adjusted, 1e-12), 1.0 - 1e-12)) - shock))
    return p_value, effect, max(0.0, effect - (row.effect - (row.effect_lower or 0.0)))


def _told(row: Prediction, rng: np.random.Generator) -> float:
    """What a variable tells, drawn from the normal distribution of its interval.

    Of the past the upper end may be that of another estimate, so the nearer end is taken twice.
    """
    wide = min(row.told_upper - row.told, row.told - row.told_lower) / TWO_SIDED_90
    wide = max(0.0, wide)
    return row.told + wide * float(rng.normal())


def _mode(mode: ModeOutcome, rng: np.random.Generator) -> tuple[int, int]:
    """Successes and admissible chunks."""
    successes, admissible = mode.successes, mode.admissible
    if mode.episodes:
        successes = int(rng.binomial(mode.episodes, mode.successes / mode.episodes))
    if mode.checked:
        admissible = int(rng.binomial(mode.checked, mode.admissible / mode.checked))
    return successes, admissible
