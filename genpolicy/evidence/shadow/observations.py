"""Held-out moments of a dataset, in equal numbers from every phase."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import Dataset
from genpolicy.evidence.admission_context import COMMANDS_AT_THE_BOUNDARY

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Observation:
    """One held-out moment.

    Attributes:
        episode_uuid: Its episode.
        index: Its row there.
        phase: Its task phase.
        calibration_epoch: Its calibration.
        history: The last H_o observations. Shape (H_o, D_o).
        commanded: The last commands up to the observation. Shape (n, 10).
        demonstrated: What the operator did next. Shape (K, 10).
    """

    episode_uuid: str
    index: int
    phase: str
    calibration_epoch: str
    history: Array
    commanded: Array
    demonstrated: Array


def held_out_observations(
    data: Dataset, *, horizons: HorizonConfig, count: int, generator: np.random.Generator
) -> list[Observation]:
    """Held-out rows of successful episodes, drawn in equal numbers from every phase."""
    cut = data.windows(
        "test",
        observation_horizon=horizons.observation_horizon,
        prediction_horizon=horizons.prediction_horizon,
    )
    lengths = data.episodes["rows"].to_numpy(dtype=np.int64)
    first = (np.cumsum(lengths) - lengths)[cut.episode]
    rows = first + cut.index
    phases = data.frames.phase[rows]
    names = sorted(set(phases.tolist()))
    chosen: list[int] = []
    for name in names:
        of_phase = np.flatnonzero(phases == name)
        size = min(len(of_phase), count // len(names))
        chosen += sorted(generator.choice(of_phase, size=size, replace=False).tolist())
    result = []
    for window in chosen:
        row, begin = int(rows[window]), int(first[window])
        back = np.arange(row - COMMANDS_AT_THE_BOUNDARY + 1, row + 1)
        episode = data.episodes.iloc[int(cut.episode[window])]
        result.append(
            Observation(
                episode_uuid=str(episode["episode_uuid"]),
                index=int(cut.index[window]),
                phase=str(phases[window]),
                calibration_epoch=str(episode["calibration_epoch"]),
                history=cut.observations[window],
                commanded=data.frames.action[np.maximum(back, begin)],
                demonstrated=cut.actions[window],
            )
        )
    return result


def spread(observations: list[Observation], count: int) -> list[Observation]:
    """About `count` of the observations, at equal distances."""
    return observations[:: max(1, len(observations) // count)]
