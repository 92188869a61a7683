"""Entries into recovery of the matched comparison, and what of them each method recovers.

Rows say of each entry how it ended and what followed; each rollout must say the same of its last
one. Entries of one start are no independent draws: intervals count starts.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from gates.bounds import mean_gain, share_interval
from gates.evidence import Array, Evidence, MissingEvidenceError, flags
from gates.recount import is_one
from gates.stress.rollouts import DRILL, STRESS, StressSettings, rollouts
from genpolicy.evidence.rows.stress import RecoveryRow
from genpolicy.statistics.eprocess import gain_interval

RECOVERED_ROWS = "recoveries.parquet"
RECOVERIES = f"{STRESS}/{RECOVERED_ROWS}"
PUSH = "push"
PERTURBED = (DRILL, PUSH)
"""Conditions that put the arm where the policy did not mean to be, on every start."""
ROLLOUT = ["seed", "perturbation", "start"]
HANDED_BACK = "handed_back"
"""How an entry ended whose last primitive reached its goal (`RecoveryRow`)."""
RECOVERED = is_one("recovered", True)
"""Of an entry into recovery."""


def recoveries(
    evidence: Evidence, settings: StressSettings, method: str, *, folder: str = STRESS
) -> pd.DataFrame:
    """Entries into recovery of a method under the planned conditions; none where none began.

    Arguments as of `rollouts`.

    Raises:
        MissingEvidenceError: As `rollouts`, a rollout and its entries differ, or an entry counts as
            recovered by which nothing was.
    """
    rolled = rollouts(evidence, settings, method, folder=folder)
    path = f"{folder}/{RECOVERED_ROWS}"
    began = rolled[flags(rolled, "recovery_attempted")]
    if np.any(flags(began, "recovered") & ~flags(began, "success")):
        raise MissingEvidenceError("a rollout recovered and did not succeed")
    if len(began) == 0:
        frame = pd.DataFrame([vars(row) for row in evidence.records(path, RecoveryRow)])
        own = frame[frame["method"] == method] if len(frame) else frame
    else:
        own = evidence.of(path, RecoveryRow, method)
    if len(own):
        own = own[own["perturbation"].isin(settings.perturbations)]
        _require_recovered(own, method)
    stated = dict(zip(_keys(began), flags(began, "recovered"), strict=True))
    last = own.sort_values("recovery").drop_duplicates(ROLLOUT, keep="last") if len(own) else own
    found = dict(zip(_keys(last), flags(last, "recovered"), strict=True)) if len(own) else {}
    differ = sorted(key for key in {*stated, *found} if stated.get(key) != found.get(key))
    if differ:
        seed, condition, start = differ[0]
        raise MissingEvidenceError(
            f"rollout {method}, seed {seed}, {condition}, start {start}: it and its entries into "
            "recovery say otherwise whether it recovered"
        )
    return own


def _require_recovered(entries: pd.DataFrame, method: str) -> None:
    """What counts as recovered is judged, and what `RecoveryRow` asks of it stands beside it.

    Raises:
        MissingEvidenceError: An entry counts and did not hand back, helped by samples alone, was
            followed by no command of the policy or by no success, or by another in its phase.
    """
    later = entries.sort_values("recovery")
    again = later.duplicated([*ROLLOUT, "phase"], keep="last").reindex(entries.index).to_numpy()
    helped = (entries["ended"] == HANDED_BACK).to_numpy() & ~flags(entries, "resampled_only")
    helped &= flags(entries, "taken_over") & flags(entries, "succeeded")
    wrong = entries[flags(entries, "recovered") & (again | ~helped)]
    if len(wrong):
        row = wrong.iloc[0]
        raise MissingEvidenceError(
            f"rollout {method}, seed {row['seed']}, {row['perturbation']}, start {row['start']}: "
            f"entry {row['recovery']} into recovery counts as recovered, and was not by what is "
            "told of it"
        )


def _keys(rows: pd.DataFrame) -> list[tuple[int, str, int]]:
    return list(zip(*(rows[name] for name in ROLLOUT), strict=True))


def recovered_share(rows: pd.DataFrame, *, confidence: float) -> tuple[float, float, float]:
    """Share of entries that count as recovered, with its exact interval over starts.

    Raises:
        MissingEvidenceError: No entries.
    """
    return share_interval(
        flags(rows, "recovered"), rows["start"].to_numpy(), confidence=confidence, favourable=True
    )


@dataclass(frozen=True)
class Coverage:
    """What a method recovers from perturbed states that another does not.

    Attributes:
        starts: Starts that both met.
        own: Share of them, over training seeds, that the method brought to success by itself.
        other: The same of the other method.
        gain: Mean difference over the starts.
        interval: Gains that the pairs do not speak against.
        both: Starts on which both entered recovery.
        gain_of_both: The difference on these, where both must have recovered by their primitives;
            None without any.
    """

    starts: int
    own: float
    other: float
    gain: float
    interval: tuple[float, float]
    both: int
    gain_of_both: float | None


def coverage(
    evidence: Evidence, settings: StressSettings, method: str, baseline: str, condition: str
) -> Coverage:
    """Recovery from the same perturbed starts, paired: a method's share minus a baseline's.

    A start is covered where it ended in success and every recovery that it needed was one: who
    copes with a push without any recovery is not worse than who needs one.

    Raises:
        MissingEvidenceError: As `recoveries`, or no start is shared.
    """
    own, other = (_covered(evidence, settings, name, condition) for name in (method, baseline))
    common = own.index.intersection(other.index)
    if len(common) == 0:
        raise MissingEvidenceError(f"no start is shared with {baseline} in {condition}")
    pairs: Array = (own.loc[common, "covered"] - other.loc[common, "covered"]).to_numpy(np.float64)
    entered = common[(own.loc[common, "entered"] & other.loc[common, "entered"]).to_numpy()]
    of_both = own.loc[entered, "covered"] - other.loc[entered, "covered"]
    return Coverage(
        starts=len(common),
        own=float(own.loc[common, "covered"].mean()),
        other=float(other.loc[common, "covered"].mean()),
        gain=mean_gain(pairs),
        interval=gain_interval(pairs, alpha=1.0 - settings.confidence),
        both=len(entered),
        gain_of_both=mean_gain(of_both.to_numpy(np.float64)) if len(entered) else None,
    )


def _covered(
    evidence: Evidence, settings: StressSettings, method: str, condition: str
) -> pd.DataFrame:
    """By start: the share of its rollouts that is covered, and whether each entered recovery."""
    recoveries(evidence, settings, method)  # refused where rollouts and entries differ
    rows = rollouts(evidence, settings, method)
    rows = rows[rows["perturbation"] == condition]
    entered = flags(rows, "recovery_attempted")
    by_itself = flags(rows, "success") & (flags(rows, "recovered") | ~entered)
    told = rows.assign(covered=by_itself.astype(np.float64), entered=entered)
    return told.groupby("start").agg(covered=("covered", "mean"), entered=("entered", "all"))
