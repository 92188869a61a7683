"""Held-out moments of a dataset: in equal numbers from every phase, and where modes were found."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import Dataset
from genpolicy.data.frames import Windows
from genpolicy.errors import ContractError
from genpolicy.evidence.admission_context import COMMANDS_AT_THE_BOUNDARY
from genpolicy.evidence.need.method_modes import one_per_episode, read_situations

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
    return [_observation(data, cut, window) for window in chosen]


def two_mode_observations(
    data: Dataset, audit: Path, *, horizons: HorizonConfig
) -> list[Observation]:
    """The earliest held-out situation of each episode and phase in which the audit found modes.

    Args:
        data: The dataset.
        audit: Folder of the audit of this dataset.
        horizons: Common horizons.

    Raises:
        ContractError: The audit names a row that the dataset does not have in that split.
    """
    situations = one_per_episode(read_situations(audit))
    found: dict[tuple[str, str, int], Observation] = {}
    for split in sorted({situation.split for situation in situations}):
        cut = data.windows(
            split,
            observation_horizon=horizons.observation_horizon,
            prediction_horizon=horizons.prediction_horizon,
            only_success=False,
        )
        names = data.episodes["episode_uuid"].to_numpy(dtype=str)[cut.episode]
        windows = {key: i for i, key in enumerate(zip(names.tolist(), cut.index, strict=True))}
        for item in (s for s in situations if s.split == split):
            window = windows.get((item.episode_uuid, item.index))
            if window is None:
                raise ContractError(
                    where=f"situation {item.episode_uuid}, row {item.index}",
                    found=f"not in the split {split} of the dataset",
                    expected="a row of the dataset that the audit looked at",
                    action="Run the audit on this dataset (`dvc repro audit`).",
                )
            found[split, item.episode_uuid, item.index] = _observation(data, cut, window)
    return [found[s.split, s.episode_uuid, s.index] for s in situations]


def _observation(data: Dataset, cut: Windows, window: int) -> Observation:
    """The moment of one window, with the commands before it."""
    lengths = data.episodes["rows"].to_numpy(dtype=np.int64)
    number, index = int(cut.episode[window]), int(cut.index[window])
    begin = int(lengths[:number].sum())
    row = begin + index
    back = np.arange(row - COMMANDS_AT_THE_BOUNDARY + 1, row + 1)
    episode = data.episodes.iloc[number]
    return Observation(
        episode_uuid=str(episode["episode_uuid"]),
        index=index,
        phase=str(data.frames.phase[row]),
        calibration_epoch=str(episode["calibration_epoch"]),
        history=cut.observations[window],
        commanded=data.frames.action[np.maximum(back, begin)],
        demonstrated=cut.actions[window],
    )


def spread(observations: list[Observation], count: int) -> list[Observation]:
    """About `count` of the observations, at equal distances."""
    return observations[:: max(1, len(observations) // count)]
