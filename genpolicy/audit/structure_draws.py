"""Support, structure and data semantics on resampled episodes, beside the other measures.

Support and structure are drawn with the held-out episodes: each situation counts as often as its
episode was drawn. Data semantics are measured again on halves of the episodes, which scatter as
much about the whole as a bootstrap does and, unlike one, hold no episode twice.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Episodes, Integers, canonical
from genpolicy.audit.documents import Counts
from genpolicy.audit.neighbourhoods import Support
from genpolicy.audit.reach import FIFTHS, departures, fifth_of, with_departures
from genpolicy.audit.reach_rows import FindingDraw, StructureDraw
from genpolicy.audit.semantics import measure
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.situations import Situation
from genpolicy.seeds import stream

# Halves of the episodes that are measured again, and of how many rows in all at most.
HALVES = 10
HALVED_ROWS = 400_000


@dataclass(frozen=True)
class Queries:
    """Every query of the audit, to draw episodes from.

    Attributes:
        episodes: Held-out episodes with a query. Shape (E,).
        place: Position in `episodes` of each query. Shape (q,).
        fifth: Fifth of the way of each query. Shape (q,).
        analysed: Whether it has enough neighbours. Shape (q,).
        phase: Number of the phase of each situation; they come first. Shape (n,).
        resolved: Whether it has clusters that are not claimed as modes. Shape (n,).
        noise: Its noise ratio, spread and white share. Shape (n, 3).
    """

    episodes: Integers
    place: Integers
    fifth: Integers
    analysed: Array
    phase: Integers
    resolved: Array
    noise: Array


def queries_of(
    data: AuditInput,
    settings: AuditSettings,
    situations: Sequence[Situation],
    support: Sequence[Support],
) -> Queries:
    """The queries behind situations and support, the situations first."""
    rows = [item.neighbourhood.query for item in situations]
    rows += [row for reach in support for row in reach.missed]
    queries = np.asarray(rows, dtype=np.int64)
    episodes, place = np.unique(data.episode[queries], return_inverse=True)
    analysed = np.arange(len(queries)) < len(situations)
    fifth, departs = fifth_of(data, settings, queries), departures(data, settings, queries)
    return Queries(
        episodes=episodes,
        place=np.asarray(place.reshape(-1), dtype=np.int64),
        fifth=with_departures(fifth, departs, analysed),
        analysed=analysed.astype(np.float64),
        phase=np.unique([item.phase for item in situations], return_inverse=True)[1].reshape(-1),
        resolved=np.array(
            [item.clustering.count > 1 and not item.two_mode for item in situations], dtype=bool
        ),
        noise=np.array(
            [(item.noise_ratio, item.noise_spread, item.white_share) for item in situations]
        ).reshape(-1, 3),
    )


def structure_draw(
    queries: Queries,
    times: Integers,
    kept: Array,
    *,
    measured: Counts,
    findings: int,
    successes: tuple[int, ...],
) -> StructureDraw:
    """Support and structure of one draw.

    Args:
        queries: Every query.
        times: How often each episode of `queries.episodes` was drawn. Shape (E,).
        kept: Situations whose modes are kept in this draw. Shape (n,).
        measured: What was measured, for the medians where nothing was drawn.
        findings: Which half of the episodes gives the findings of this draw, -1 for the whole.
        successes: Drawn successes of each mode.
    """
    weight = times[queries.place].astype(np.float64)
    spoke = weight * queries.analysed
    count = len(queries.phase)
    inside, place = spoke[:count], queries.place[:count]
    several = np.bincount(queries.phase, weights=inside * kept, minlength=1)
    of_primary = inside * (queries.phase == int(np.argmax(several))) * bool(several.any())
    usual = [measured.noise_ratio, measured.noise_spread, measured.white_share]
    if inside.any():
        usual = np.median(np.repeat(queries.noise, inside.astype(int), axis=0), axis=0).tolist()
    return StructureDraw(
        queries=int(weight.sum()),
        analysed=int(spoke.sum()),
        analysed_episodes=_episodes(times, place, inside),
        primary_episodes=_episodes(times, place, of_primary),
        resolved=int(np.sum(inside * queries.resolved)),
        noise_ratio=usual[0],
        noise_spread=usual[1],
        white_share=usual[2],
        reach_queries=_by_fifth(queries.fifth, weight),
        reach_spoke=_by_fifth(queries.fifth, spoke),
        findings=findings,
        successes=successes,
    )


def finding_draws(
    data: AuditInput, settings: AuditSettings, *, root_seed: int
) -> tuple[int, tuple[FindingDraw, ...]]:
    """Findings of halves of the episodes.

    Returns:
        Number of halves, none where the rows are too many to measure them again, and findings.
    """
    halves = min(HALVES, 2 * HALVED_ROWS // max(len(data.observation), 1))
    rows: list[FindingDraw] = []
    if len(data.episodes) < 4:
        return 0, ()
    for number in range(halves):
        rng = stream(root_seed, "audit", "halves", str(number))
        found = measure(_half(data, rng), settings).findings
        rows += [FindingDraw(draw=number, **vars(item)) for item in found]
    return halves, tuple(rows)


def _half(data: AuditInput, rng: np.random.Generator) -> AuditInput:
    """Half of the episodes, each split by itself, so that none is without."""
    kept: list[int] = []
    for split in np.unique(data.episodes.split):
        members = np.flatnonzero(data.episodes.split == split)
        size = max(1, len(members) // 2)
        kept += rng.choice(members, size, replace=False).tolist()
    chosen = np.sort(np.asarray(kept, dtype=np.int64))
    place = np.full(len(data.episodes), -1, dtype=np.int64)
    place[chosen] = np.arange(len(chosen))
    rows = place[data.episode] >= 0
    table = data.episodes
    part = replace(
        data,
        observation=data.observation[rows],
        action=data.action[rows],
        phase=data.phase[rows],
        episode=place[data.episode[rows]],
        index=data.index[rows],
        event_time_s=data.event_time_s[rows],
        delay_s={name: values[rows] for name, values in data.delay_s.items()},
        stream_time_s={name: values[rows] for name, values in data.stream_time_s.items()},
        episodes=Episodes(
            **{name: getattr(table, name)[chosen] for name in Episodes.__dataclass_fields__}
        ),
    )
    return canonical(part)


def _episodes(times: Integers, place: Integers, weight: Array) -> int:
    seen = np.bincount(place, weights=weight, minlength=len(times)) > 0
    return int(np.sum(times * seen))


def _by_fifth(fifth: Integers, weight: Array) -> tuple[int, ...]:
    return tuple(
        int(value) for value in np.bincount(fifth, weights=weight, minlength=FIFTHS)[:FIFTHS]
    )
