"""Does the mean action fail where the modes pass? Each through the same feasibility check.

Chunks of other episodes are moved to the TCP of the situation, the same way for mean, median
and modes, so that none is refused for where it came from. Averaged rotations are
orthonormalised first: a mean must fail by what it does, not by how it is written.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from genpolicy.audit.data import Array, AuditInput, chunk_rows, origin
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.settings import AuditSettings
from genpolicy.contract.rotation import rotation_from_6d, rotation_to_6d

Admissible = Callable[[Array, Array], tuple[bool, str]]


@dataclass(frozen=True)
class MeanVersusModes:
    """Mean, median and modal chunks of one situation.

    Attributes:
        mean: Shape (K, D_a).
        median: Shape (K, D_a).
        modes: One medoid per mode. Shape (M, K, D_a).
        mean_admissible: None where it was not checked.
        mean_reason: First reason of the refusal, empty if admissible.
        median_admissible: As for the mean.
        mode_admissible: One per mode; empty where it was not checked.
    """

    mean: Array
    median: Array
    modes: Array
    mean_admissible: bool | None
    mean_reason: str
    median_admissible: bool | None
    mode_admissible: tuple[bool, ...]


def compare(
    data: AuditInput,
    settings: AuditSettings,
    situation: Neighbourhood,
    clustering: Clustering,
    *,
    admissible: Admissible | None,
) -> MeanVersusModes:
    """Build the chunks of one situation and check each of them.

    Args:
        data: Canonical audit input.
        settings: Chunk length.
        situation: The situation.
        clustering: Its modes.
        admissible: Called as `admissible(actions (K, D_a), observation (D_o,))`; None: not
            checked.
    """
    members = situation.members
    actions = data.action[chunk_rows(data, members, settings.chunk_rows)].copy()
    start = origin(data, members)
    move = start[-1] - start  # the query is the last member
    if data.forms is not None:
        columns = np.arange(data.action.shape[1])[data.action_position]
        # Changes and rates are the same wherever the chunk begins.
        move = np.where(data.forms.added[columns], 0.0, move / data.forms.gain[columns])
    actions[:, :, data.action_position] += move[:, None, :]
    mean = _orthonormal(data, actions.mean(axis=0))
    median = _orthonormal(data, np.median(actions, axis=0))
    modes = actions[list(clustering.medoids)]
    if admissible is None:
        return MeanVersusModes(mean, median, modes, None, "", None, ())
    observation = data.observation[situation.query]
    mean_passes, reason = admissible(mean, observation)
    return MeanVersusModes(
        mean=mean,
        median=median,
        modes=modes,
        mean_admissible=mean_passes,
        mean_reason="" if mean_passes else reason,
        median_admissible=admissible(median, observation)[0],
        mode_admissible=tuple(admissible(mode, observation)[0] for mode in modes),
    )


def _orthonormal(data: AuditInput, actions: Array) -> Array:
    if data.action_rotation is not None:
        columns = actions[:, data.action_rotation]
        actions[:, data.action_rotation] = rotation_to_6d(rotation_from_6d(columns))
    return actions
