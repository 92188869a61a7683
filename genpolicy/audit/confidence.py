"""How sure is the verdict? The share of resampled audits that name the same cause.

Held-out episodes are drawn again with replacement, labels and outcomes again from their measured
shares, effects and p-values again from their sampling distributions, and the same rules decide.
A verdict that hangs on a handful of episodes near a limit gets a low number. It says how stable
the verdict is under the sampling of the data, not how likely a cause is that the audit cannot see.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from genpolicy.audit.data import Array, AuditInput, Integers
from genpolicy.audit.labels import ModeOutcome, Replayed
from genpolicy.audit.persistence import NULL_QUANTILE, Persistence
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.situations import Claim, Situation, claims_of, coherent_phases
from genpolicy.audit.strata import Stratum
from genpolicy.audit.verdict import AuditVerdict, Counts, Layers, decide
from genpolicy.seeds import stream
from genpolicy.statistics.intervals import clopper_pearson

TWO_SIDED_95 = 1.96


@dataclass(frozen=True)
class Table:
    """Situations as arrays, to draw episodes from.

    Attributes:
        episodes: Held-out episodes with an analysed situation. Shape (E,).
        place: Position in `episodes` of each situation. Shape (n,).
        phases: Phase of each situation. Length n.
        claims: What speaks for the modes of those claimed, before phases were held to persist.
        claimed: Several clusters claimed as modes, per situation. Shape (n,).
        identity: Situation, identity kept, and its null, of those measured.
    """

    episodes: Integers
    place: Integers
    phases: list[str]
    claims: list[Claim]
    claimed: Array
    identity: tuple[Integers, Array, Array]


def confidence(
    data: AuditInput,
    settings: AuditSettings,
    layers: Layers,
    situations: tuple[Situation, ...],
    verdict: AuditVerdict,
    *,
    root_seed: int,
) -> float:
    """Share of resampled audits with the same cause and variable.

    Args:
        data: Canonical audit input.
        settings: Limits and number of draws.
        layers: What was measured.
        situations: Every analysed situation, before phases were held to persist.
        verdict: What was decided.
        root_seed: Seed of the draws.

    Returns:
        Between 0 and 1.
    """
    rng = stream(root_seed, "audit", "confidence")
    table = _table(data, situations)
    same = 0
    for _ in range(settings.resamples):
        drawn = decide(settings, _draw(settings, layers, table, rng))
        same += (drawn.cause, drawn.variable) == (verdict.cause, verdict.variable)
    return same / settings.resamples


def _table(data: AuditInput, situations: tuple[Situation, ...]) -> Table:
    queries = np.array([item.neighbourhood.query for item in situations], dtype=np.int64)
    episodes, place = np.unique(data.episode[queries], return_inverse=True)
    known = [(n, item.identity) for n, item in enumerate(situations) if item.identity is not None]
    return Table(
        episodes=episodes,
        place=place.reshape(-1),
        phases=[item.phase for item in situations],
        claims=claims_of(situations),
        claimed=np.array([item.two_mode for item in situations], dtype=np.float64),
        identity=(
            np.array([n for n, _ in known], dtype=np.int64),
            np.array([value[0] for _, value in known]),
            np.stack([value[1] for _, value in known]) if known else np.zeros((0, 1)),
        ),
    )


def _draw(
    settings: AuditSettings, layers: Layers, table: Table, rng: np.random.Generator
) -> Layers:
    count = len(table.episodes)
    times = np.bincount(rng.integers(0, count, count), minlength=count) if count else table.episodes
    weights = times[table.place].astype(np.float64)
    good = coherent_phases(settings, table.claims, weights)
    kept = table.claimed * np.array([phase in good for phase in table.phases])
    return replace(
        layers,
        replayed=_replayed(layers.replayed, rng),
        counts=_counts(layers.counts, table, times, kept),
        persistence=_persistence(layers.persistence, table, weights * kept),
        strata=tuple(_stratum(row, rng) for row in layers.strata),
        modes=tuple(_mode(mode, rng) for mode in layers.modes),
    )


def _counts(counts: Counts, table: Table, times: Integers, kept: Array) -> Counts:
    weights = times[table.place]
    two_mode = np.bincount(table.place, weights=kept, minlength=len(times)) > 0
    return replace(
        counts,
        two_mode=int(np.sum(weights * kept)),
        two_mode_episodes=int(np.sum(times * two_mode)),
        incoherent=int(np.sum(weights * (table.claimed - kept))),
    )


def _persistence(measured: Persistence, table: Table, weight: Array) -> Persistence:
    numbers, shares, null = table.identity
    if len(numbers) == 0:
        return measured
    weights = weight[numbers]
    if weights.sum() <= 0.0:
        return replace(measured, n=0)
    expected = weights @ null / weights.sum()
    return replace(
        measured,
        observed=float(np.average(shares, weights=weights)),
        null_q95=float(np.quantile(expected, NULL_QUANTILE)),
        null_mean=float(expected.mean()),
        n=int(weights.sum()),
    )


def _replayed(replayed: tuple[Replayed, ...], rng: np.random.Generator) -> tuple[Replayed, ...]:
    return tuple(replayed[k] for k in rng.integers(0, len(replayed), len(replayed)))


def _stratum(row: Stratum, rng: np.random.Generator) -> Stratum:
    """Effect and p-value drawn from their sampling distributions."""
    if row.p_adjusted is None or row.effect is None:
        return row
    wide = (row.effect_upper or 0.0) - (row.effect_lower or 0.0)
    shock = float(rng.normal())
    effect = min(1.0, max(0.0, row.effect + shock * wide / (2 * TWO_SIDED_95)))
    p_value = float(norm.sf(norm.isf(min(max(row.p_adjusted, 1e-12), 1.0 - 1e-12)) + shock))
    lower = max(0.0, effect - (row.effect - (row.effect_lower or 0.0)))
    return replace(row, effect=effect, effect_lower=lower, p_adjusted=p_value)


def _mode(mode: ModeOutcome, rng: np.random.Generator) -> ModeOutcome:
    successes, admissible = mode.successes, mode.admissible
    if mode.episodes:
        successes = int(rng.binomial(mode.episodes, mode.successes / mode.episodes))
    if mode.checked:
        admissible = int(rng.binomial(mode.checked, mode.admissible / mode.checked))
    lower, upper = clopper_pearson(successes, mode.episodes)
    return replace(
        mode, successes=successes, success_lower=lower, success_upper=upper, admissible=admissible
    )
