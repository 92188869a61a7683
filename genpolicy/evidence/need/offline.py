"""Errors of a policy on the held-out splits, by phase."""

from dataclasses import asdict

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import Dataset
from genpolicy.evidence.rows.need import OfflineRow
from genpolicy.policies.matched_training import training_windows
from genpolicy.policies.offline import masked_errors
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.protocol import NoiseName

SPLITS = ("validation", "test")


def offline_rows(
    policy: NetworkPolicy, data: Dataset, *, seed: int, horizons: HorizonConfig
) -> list[OfflineRow]:
    """Rows of `offline.parquet` of one checkpoint.

    Args:
        policy: The checkpoint under its own sampler.
        data: The dataset.
        seed: Number of its training seed.
        horizons: Common horizons, which cut the windows.
    """
    rows = []
    for split in SPLITS:
        cut = data.windows(
            split,
            observation_horizon=horizons.observation_horizon,
            prediction_horizon=horizons.prediction_horizon,
        )
        uuids = data.episodes["episode_uuid"].to_numpy()
        starts = data.frames.episode.searchsorted(cut.episode)
        names: list[NoiseName] = [
            ("offline", str(uuids[e]), int(i)) for e, i in zip(cut.episode, cut.index, strict=True)
        ]
        errors = masked_errors(
            policy,
            training_windows(data, split, horizons),
            phases=data.frames.phase[starts + cut.index],
            normalisation=data.normalisation,
            noise_names=names,
        )
        rows += [
            OfflineRow(method=policy.method, seed=seed, split=split, **asdict(error))
            for error in errors
        ]
    return rows
