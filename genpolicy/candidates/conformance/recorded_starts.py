"""Recorded moments that a candidate is asked about: one of each episode, then more of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM, GRIPPER, POSITION, ROTATION
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.observation import ObservationContract
from genpolicy.data.contract import TCP_ACTION
from genpolicy.data.dataset import Dataset
from genpolicy.errors import ContractError
from genpolicy.seeds import stream

Array = NDArray[np.float64]

HELD_OUT = ("validation", "test")
MEASURED = {
    "tcp_position_m": POSITION, "tcp_rotation": ROTATION,
    "gripper_opening_m": slice(GRIPPER, GRIPPER + 1),
}  # fmt: skip
"""Channels of the robot's own state, as tasks and importers name them, by columns of an action."""
MOST_STARTS = 80
"""The 95th percentile of a time has an upper end from 72 independent ones on."""
MOST_MOMENTS = 240
"""Whoever answers within a deadline of 0.15 s has answered them in 36 s."""
OF_AN_EPISODE = 5
"""Moments of an episode, at most. Where several ways are open a mirrored chunk is another way;
behind a fork it is none, and of five, a fifth of the episode apart, one or two lie there."""


@dataclass(frozen=True)
class RecordedStarts:
    """What was seen, and what a demonstrator did next.

    Attributes:
        observations: Physical units, newest last. Shape (M, H_o, D_o).
        chunks: Recorded actions from the newest observation on. Shape (M, K, 10).
        episodes: Identifier of each one's episode: one of each first, then further ones, of all
            episodes in turn. Shape (M,).
        measured: Where the TCP and the gripper were at the newest observation, in the columns of
            an action; NaN where the observation does not say. Shape (M, 10).
    """

    observations: Array
    chunks: Array
    episodes: NDArray[np.str_]
    measured: Array

    def __len__(self) -> int:
        return len(self.episodes)

    @property
    def apart(self) -> int:
        """How many of the first moments are each of another episode: independent of each other."""
        return len(np.unique(self.episodes))


def measured(observations: Array, contract: ObservationContract) -> Array:
    """The newest observations (M, H_o, D_o) of pose and gripper, as actions (M, 10)."""
    found = np.full((len(observations), ACTION_DIM), np.nan)
    for name, columns in MEASURED.items():
        part = contract.slices.get(name)
        if part is not None and part.stop - part.start == columns.stop - columns.start:
            found[:, columns] = observations[:, -1, part]
    return found


def require_contract(data: Dataset, horizons: HorizonConfig, *, candidate: str) -> None:
    """Refuse a dataset whose actions are others than a candidate's can be.

    Raises:
        ContractError: Another period, or actions that are no pose of the TCP.
    """
    action = data.manifest["action_contract"]
    if action["sha256"] != TCP_ACTION.sha256:
        raise ContractError(
            where="actions of the dataset",
            found=f"{action['dim']} numbers in the frame {action['frame']}",
            expected="TCP pose and gripper opening in the robot's base frame",
            action="Check the candidate on a dataset of the task that it is for.",
        )
    if action["period_s"] != horizons.action_period_s:
        raise ContractError(
            where=f"horizons.action_period_s of the candidate {candidate}",
            found=f"{horizons.action_period_s:g} s",
            expected=f"{action['period_s']:g} s, as in the dataset",
            action="Declare the period that the candidate was trained with, and check it on "
            "recordings of that period.",
        )


def recorded_starts(
    data: Dataset, horizons: HorizonConfig, *, seed: int, most: int = MOST_STARTS
) -> RecordedStarts:
    """A moment of each held-out episode, evenly spread from the first row to the last whole chunk.

    Each episode draws its place from a stream of its own name, so that the same moments are asked
    about in whatever order episodes lie, and nobody knows them who does not know the seed. Further
    moments of the same episodes follow, each a J-th of the episode behind the one before it, from
    its end on to its start: J is `OF_AN_EPISODE`, or what `MOST_MOMENTS` leaves.

    Args:
        data: A verified dataset.
        horizons: Of the candidate.
        seed: Root seed.
        most: Episodes, at most.

    Raises:
        ContractError: No held-out episode is as long as a chunk.
    """
    observations, chunks, episodes = [], [], []
    for split in HELD_OUT:
        cut = data.windows(
            split, horizons.observation_horizon, horizons.prediction_horizon, only_success=False
        )
        whole = np.flatnonzero(~cut.is_pad.any(axis=1))
        for episode in np.unique(cut.episode[whole]):
            rows = whole[cut.episode[whole] == episode]
            observations.append(cut.observations[rows])
            chunks.append(cut.actions[rows])
            episodes.append(data.episodes["episode_uuid"].iloc[int(episode)])
    if not episodes:
        raise ContractError(
            where="held-out episodes of the dataset",
            found=f"none of {horizons.prediction_horizon} rows",
            expected="at least one as long as a chunk",
            action="Record longer episodes, or declare a shorter prediction_horizon.",
        )
    number = min(most, len(episodes))
    drawn = {str(uuid): stream(seed, *STREAM, str(uuid)).random() for uuid in episodes}
    chosen = sorted(range(len(episodes)), key=lambda one: (drawn[str(episodes[one])], one))[:number]
    shares = np.modf(np.arange(number) * GOLDEN)[0]
    # Neighbours in the list lie apart in their episodes, so that every phase is asked about.
    parts = min(OF_AN_EPISODE, MOST_MOMENTS // number)
    at = [
        (episode, int((share + part / parts) % 1.0 * len(chunks[episode])))
        for part in range(parts)
        for share, episode in zip(shares, chosen, strict=True)
    ]
    seen = np.stack([observations[episode][row] for episode, row in at])
    return RecordedStarts(
        seen,
        np.stack([chunks[episode][row] for episode, row in at]),
        np.array([episodes[episode] for episode, _ in at]),
        measured(seen, data.observation_contract),
    )


STREAM = ("conformance", "moments")
GOLDEN = 0.6180339887498949
"""Multiples of the golden ratio, modulo 1, are evenly spread however many there are."""
