"""The planar rows as an ingested dataset."""

import numpy as np
import pandas as pd

from genpolicy.contract.normalisation import Normalisation, statistics_of
from genpolicy.data.dataset import Dataset
from genpolicy.data.frames import Frames


def dataset_of(data, *, unit="m", manifest=None):
    """The planar rows as an ingested dataset."""
    table, n = data.episodes, len(data.observation)
    channels = [
        {"name": "tcp", "components": ["x", "y"]},
        {"name": "goal", "components": ["x_m", "y_m"]},
        {"name": "lamp", "components": ["on"]},
    ]
    stored = {
        "observation_contract": {
            "channels": [
                {**c, "unit": unit if c["name"] != "lamp" else "1", "stream": "robot",
                 "maximum_age_s": 0.5} for c in channels
            ],
        },
        "action_contract": {"components": ["x", "y"], "units": [unit] * 2, "period_s": 0.1},
        **(manifest or {}),
    }  # fmt: skip
    frames = Frames(
        episode=data.episode, index=data.index, event_time_s=data.event_time_s,
        observation=data.observation, action=data.action, phase=data.phase,
        stream_event_time_s={"robot": data.event_time_s},
        stream_receive_time_s={"robot": data.event_time_s},
    )  # fmt: skip
    episodes = pd.DataFrame({
        "episode_uuid": table.uuid, "split": table.split, "operator": table.operator,
        "object": table.object, "calibration_epoch": table.calibration_epoch,
        "outcome": table.outcome, "is_recovery": table.is_recovery,
        "recorded_at_s": table.order, "rows": np.bincount(data.episode, minlength=len(table)),
    })  # fmt: skip
    assert n == len(frames)
    normalisation = Normalisation(statistics_of(data.observation), statistics_of(data.action))
    return Dataset(frames, episodes, stored, "ab" * 32, normalisation)
