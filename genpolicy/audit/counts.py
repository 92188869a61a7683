"""What was found, counted; episodes are distinct held-out episodes."""

import numpy as np

from genpolicy.audit.data import Array, AuditInput, relative_paths
from genpolicy.audit.neighbourhoods import Support
from genpolicy.audit.persistence import persistent
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.situations import Situation, by_phase, episodes_of, primary_phase
from genpolicy.audit.verdict import Counts


def count(
    data: AuditInput,
    settings: AuditSettings,
    situations: tuple[Situation, ...],
    support: tuple[Support, ...],
) -> Counts:
    """Counts of all situations, and what their spread looks like."""
    several = [item for item in situations if item.two_mode]
    primary = primary_phase(by_phase(situations))
    ratios, spreads = [], []
    for item in situations:
        paths = relative_paths(data, item.neighbourhood.members, settings.chunk_steps)
        ratio, spread = _noise(paths)
        ratios.append(ratio)
        spreads.append(spread)
    return Counts(
        queries=sum(item.queries for item in support),
        analysed=len(situations),
        analysed_episodes=episodes_of(data, [item.neighbourhood for item in situations]),
        two_mode=len(several),
        two_mode_episodes=episodes_of(data, [item.neighbourhood for item in several]),
        needed_episodes=settings.least_two_mode_episodes(
            episodes_of(data, [item.neighbourhood for item in situations if item.phase == primary])
        ),
        resolved=sum(item.clustering.count > 1 and not item.two_mode for item in situations),
        persistent=sum(persistent(item.identity) for item in several),
        noise_ratio=float(np.median(ratios)) if ratios else 0.0,
        noise_spread=float(np.median(spreads)) if spreads else 0.0,
    )


def _noise(paths: Array) -> tuple[float, float]:
    """Von Neumann ratio of the residual along the chunk (1 white, 0 smooth), and its RMS."""
    residual = paths - paths.mean(axis=0)
    residual = residual - residual.mean(axis=1, keepdims=True)
    power = float(np.mean(residual**2))
    if power <= 0.0:
        return 0.0, 0.0
    steps = float(np.mean(np.diff(residual, axis=1) ** 2))
    return steps / (2.0 * power), float(np.sqrt(power * paths.shape[2]))
