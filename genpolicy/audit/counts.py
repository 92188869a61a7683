"""What was found, counted; episodes are distinct held-out episodes."""

import numpy as np

from genpolicy.audit.data import AuditInput
from genpolicy.audit.documents import Counts
from genpolicy.audit.neighbourhoods import Support
from genpolicy.audit.persistence import persistent
from genpolicy.audit.situations import Situation, by_phase, episodes_of, primary_phase


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
