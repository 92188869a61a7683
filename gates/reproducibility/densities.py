"""Does the density of a head rank the modes as its samples do? Told, not judged.

A mode may be dense and narrow, or broad and thin: the density of one chunk is no share. How often
the two say the same of which mode comes first is what a density is worth as a stand-in for counts,
and counts for a density.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from gates.bounds import share_interval
from gates.evidence import Evidence, MissingEvidenceError, counts, numbers
from gates.reproducibility.settings import DENSITY
from genpolicy.evidence.rows.reproducibility import DensityRow

SITUATION = ["seed", "episode_uuid", "index"]


@dataclass(frozen=True)
class Agreement:
    """How often the denser mode of a situation is the one drawn more often.

    Attributes:
        method: The method.
        share: Situations in which it is, of those that can say; NaN where none can.
        interval: Its exact interval over episodes.
        situations: Situations that can say.
        tied: Those in which two modes were drawn equally often, and none more often.
        unknown: Those in which the density of a mode is infinite or no number.
        episodes: Episodes of those that can say.
    """

    method: str
    share: float
    interval: tuple[float, float]
    situations: int
    tied: int
    unknown: int
    episodes: int


def densities(evidence: Evidence) -> pd.DataFrame:
    """Modes of every situation, with `share` of the samples and `gain` over the mean log-density.

    Where the density of a mode is infinite or no number there is no mean, and `gain` is NaN for all
    modes of the situation.

    Raises:
        MissingEvidenceError: No rows, situations without samples or with fewer than two modes, or
            numbers that cannot be.
    """
    rows = evidence.rows(DENSITY, DensityRow)
    drawn, reached = numbers(rows, "samples"), counts(rows, "reached")
    if not (np.all(drawn > 0) and np.all(reached <= drawn)):
        raise MissingEvidenceError(f"{DENSITY} has a mode of more samples than were drawn")
    keys = ["method", *SITUATION]
    if rows.duplicated([*keys, "mode"]).any() or not (rows.groupby(keys).size() >= 2).all():
        raise MissingEvidenceError(f"{DENSITY} has a situation without its two modes, each once")
    stated = rows["log_density"].to_numpy(dtype=np.float64, na_value=np.nan)
    known = rows.assign(log_density=np.where(np.isfinite(stated), stated, np.nan))
    known = known.assign(share=reached / drawn)
    mean = known.groupby(keys)["log_density"].transform(lambda values: values.mean(skipna=False))
    return known.assign(gain=known["log_density"] - mean)


def agreement(rows: pd.DataFrame, method: str, *, confidence: float) -> Agreement:
    """Agreement of one method over its situations, of `densities`."""
    hits, episodes, tied, unknown = [], [], 0, 0
    for (_, episode, _), modes in rows[rows["method"] == method].groupby(SITUATION):
        if modes["gain"].isna().any():
            unknown += 1
            continue
        shares = modes["share"].to_numpy()
        if int((shares == shares.max()).sum()) > 1:
            tied += 1
            continue
        hits.append(int(shares.argmax()) == int(modes["log_density"].to_numpy().argmax()))
        episodes.append(str(episode))
    share, interval = float("nan"), (0.0, 1.0)
    if hits:
        share, *ends = share_interval(
            np.array(hits), episodes, confidence=confidence, favourable=True
        )
        interval = (ends[0], ends[1])
    return Agreement(method, share, interval, len(hits), tied, unknown, len(set(episodes)))
