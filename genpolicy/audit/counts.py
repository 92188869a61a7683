"""What was found, counted; episodes are distinct held-out episodes."""

from dataclasses import dataclass

import numpy as np

from genpolicy.audit.data import AuditInput
from genpolicy.audit.neighbourhoods import Support
from genpolicy.audit.persistence import persistent
from genpolicy.audit.situations import Situation, by_phase, episodes_of, primary_phase


@dataclass(frozen=True)
class Counts:
    """What was found, in numbers; episodes are distinct held-out episodes.

    Attributes:
        queries: Situations looked at.
        analysed: Situations with enough neighbours.
        analysed_episodes: Held-out episodes with at least one of them.
        two_mode: Situations with several modes under one observation.
        two_mode_episodes: Held-out episodes with at least one of them.
        primary_episodes: Analysed held-out episodes of the phase with most situations of several
            modes; of none where there is no such phase.
        resolved: Situations with clusters that are not claimed as modes: an observed component
            tells them apart, or they are too few in their phase.
        incoherent: Situations with clusters in phases where they do not persist.
        persistent: Situations with several modes that persist.
        noise_ratio: Median von Neumann ratio of the spread inside situations: 1 white, 0 smooth.
        noise_spread: Median spread inside situations, unit of the position.
        white_share: Median share of that white noise in all of the spread, constant differences
            between the chunks counted as well.
    """

    queries: int
    analysed: int
    analysed_episodes: int
    two_mode: int
    two_mode_episodes: int
    primary_episodes: int
    resolved: int
    incoherent: int
    persistent: int
    noise_ratio: float
    noise_spread: float
    white_share: float


def count(
    data: AuditInput,
    situations: tuple[Situation, ...],
    support: tuple[Support, ...],
    incoherent: int,
) -> Counts:
    """Counts of all situations, and what their spread looks like."""
    several = [item for item in situations if item.two_mode]
    primary = primary_phase(by_phase(situations))
    return Counts(
        queries=sum(item.queries for item in support),
        analysed=len(situations),
        analysed_episodes=episodes_of(data, [item.neighbourhood for item in situations]),
        two_mode=len(several),
        two_mode_episodes=episodes_of(data, [item.neighbourhood for item in several]),
        primary_episodes=episodes_of(
            data, [item.neighbourhood for item in situations if item.phase == primary]
        ),
        resolved=sum(item.clustering.count > 1 and not item.two_mode for item in situations)
        - incoherent,
        incoherent=incoherent,
        persistent=sum(persistent(item.identity) for item in several),
        noise_ratio=_middle([item.noise_ratio for item in situations]),
        noise_spread=_middle([item.noise_spread for item in situations]),
        white_share=_middle([item.white_share for item in situations]),
    )


def _middle(values: list[float]) -> float:
    return float(np.median(values)) if values else 0.0
