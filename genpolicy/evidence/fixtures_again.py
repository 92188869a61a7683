"""Gate B's fixtures, asked again of a server that is started for other evidence.

Files are held against their hashes when a server starts; what it answers with may change without
them, after a day or a thousand questions. So each start is asked the same as at Gate B, ahead of
everything else and behind it, and the gate of that evidence wants the same bits.
"""

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.wire.policy import WirePolicy
from genpolicy.contract.chunk import actions_sha256
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import Dataset
from genpolicy.evidence.rows.brought import FixtureAgainRow
from genpolicy.policies.fixtures import CANDIDATES, fixture_observations
from genpolicy.policies.protocol import NoiseName, Policy

Array = NDArray[np.float64]

FIXTURES = 32
NO_FIXTURES: Array = np.empty((0, 1, 1))
"""Where nobody was brought."""


def brought_fixtures(data: Dataset, horizons: HorizonConfig) -> Array:
    """What every policy that was brought is shown. Shape (FIXTURES, H_o, D_o)."""
    return fixture_observations(data, horizons=horizons, count=FIXTURES)


def fixture_name(row: int) -> NoiseName:
    """Name of the noise of a fixture."""
    return ("fixture", row)


def asked_again(
    policy: Policy, fixtures: Array, *, condition: str, when: str
) -> list[FixtureAgainRow]:
    """Ask a server; nothing of a policy that runs here, whose weights are held by their hash.

    Args:
        policy: Whoever is asked for other evidence.
        fixtures: What it is shown. Shape (F, H_o, D_o).
        condition: What its server was started for.
        when: `before` or `after` everything else.
    """
    if not isinstance(policy, WirePolicy):
        return []
    found = []
    for row, seen in enumerate(fixtures):
        chunks = policy.sample(
            seen[None], noise_names=[fixture_name(row)], candidates=CANDIDATES
        ).actions[0]
        came = not bool(np.isnan(chunks).all())
        digest = actions_sha256(chunks) if came else ""
        found.append(FixtureAgainRow(policy.method, condition, when, row, came, digest))
    return found
