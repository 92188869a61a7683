"""Modes: how many situations have two that persist, succeed, are feasible, and defeat the mean?"""

import numpy as np
import pandas as pd

from gates.bounds import counted_interval, share_interval
from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError, flags, number, numbers
from gates.need.settings import AUDIT, NeedSettings
from genpolicy.audit.rows import ModeOutcome, RecoveryOutcome, SituationRow


def _held_out(evidence: Evidence, settings: NeedSettings) -> pd.DataFrame:
    frame = evidence.rows(f"{AUDIT}/neighbourhoods.parquet", SituationRow)
    return frame[frame["split"].isin(settings.held_out_splits)]


@criterion(
    ">=",
    question="Were enough held-out situations examined?",
    look_at="Multimodality: too little support; record more episodes of the same task.",
)
def held_out_situations(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Held-out situations that were examined."""
    rows = _held_out(evidence, settings)
    return Measured(float(len(rows)), caveat=f"from {rows['episode_uuid'].nunique()} episodes")


@criterion(
    ">=",
    question="In how many do two persistent modes exist?",
    look_at="Multimodality: the actions are unimodal here; keep the simpler policy.",
)
def multimodal_situations(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Held-out situations with two clusters that persist."""
    rows = _held_out(evidence, settings)
    kept = rows[flags(rows, "two_mode") & flags(rows, "persistent")]
    text = f"from {kept['episode_uuid'].nunique()} episodes; two clusters that persist"
    return Measured(float(len(kept)), caveat=text)


@criterion(
    ">=",
    question="Does mode identity persist over steps, beyond a shuffled-time null?",
    look_at="Multimodality: this is pointwise noise (tremor, quantisation), not a mode.",
)
def persistence_margin(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Persistence of mode identity above the 95 % quantile of the shuffled-time null."""
    document = evidence.document(f"{AUDIT}/persistence.json")
    observed, null = number(document, "observed"), number(document, "null_q95")
    text = f"observed {observed:.4g}, 95 % quantile of the shuffled-time null {null:.4g}"
    return Measured(observed - null, caveat=text)


@criterion(
    ">=",
    question="Does each mode succeed?",
    look_at="Multimodality: a mode fails; separate failed and intervention targets.",
)
def mode_success_lower(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Lowest exact lower bound of success over the modes."""
    frame = evidence.rows(f"{AUDIT}/modes.parquet", ModeOutcome)
    bounds = [
        (counted_interval(hits, trials, confidence=settings.confidence), str(mode))
        for mode, trials, hits in zip(
            frame["mode"],
            numbers(frame, "episodes"),
            numbers(frame, "successes"),
            strict=True,
        )
    ]
    interval, mode = min(bounds)
    text = f"lowest over {len(bounds)} modes, at {mode}; exact lower bound; {_recovered(evidence)}"
    return Measured(interval[0], interval, text)


def _recovered(evidence: Evidence) -> str:
    """What the disturbed demonstrations did, by mode: shown, never judged."""
    try:
        frame = evidence.rows(f"{AUDIT}/recovery.parquet", RecoveryOutcome)
    except MissingEvidenceError:
        return "no disturbed demonstration is known"
    counts = frame.groupby("mode")[["successes", "episodes"]].sum()
    by_mode = ", ".join(
        f"{mode} {int(good)} of {int(episodes)}"
        for mode, (good, episodes) in zip(counts.index, counts.to_numpy(), strict=True)
    )
    return f"disturbed demonstrations that recovered (shown, not judged): {by_mode}"


@criterion(
    ">=",
    question="Is each mode feasible in all layers?",
    look_at="Multimodality: a mode breaks limits or collides; it is no valid target.",
)
def mode_feasible_share(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Lowest share of admissible modal chunks over the modes."""
    frame = evidence.rows(f"{AUDIT}/modes.parquet", ModeOutcome)
    checked = numbers(frame, "checked")
    if not np.all(checked > 0):
        raise MissingEvidenceError("a mode has no checked chunk")
    shares = numbers(frame, "admissible") / checked
    worst = int(np.argmin(shares))
    text = f"lowest over {len(shares)} modes, at {frame['mode'].iloc[worst]}"
    return Measured(float(shares[worst]), caveat=text)


@criterion(
    ">=",
    question="Is the mean rejected where every mode passes?",
    look_at="Multimodality: the mean action is admissible, so a point policy loses nothing.",
)
def mean_defeated_share(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Lower bound of the share of two-mode situations in which only the mean is rejected."""
    rows = _compared(evidence, settings, "mean")
    if len(rows) == 0:
        return Measured(0.0, caveat="no held-out situation has two modes")
    valid = numbers(rows, "modes_admissible") >= numbers(rows, "clusters")
    defeated = valid & ~flags(rows, "mean_admissible")
    share, lower, upper = share_interval(
        defeated,
        list(rows["episode_uuid"]),
        confidence=settings.confidence,
        favourable=True,
    )
    text = (
        f"share {share:.4g} of {len(rows)} situations; lower bound over "
        f"{rows['episode_uuid'].nunique()} episodes, whose situations are not independent"
    )
    return Measured(lower, (lower, upper), f"{text}; {_median(evidence, settings)}")


def _median(evidence: Evidence, settings: NeedSettings) -> str:
    """How often the point-wise median of the neighbours passes: shown, not judged.

    Of an odd number of plans on two sides, or of unequal sides, the median lies on one of them,
    so wherever each mode is valid it passes: no task with modes could meet a limit on it. What
    learns it is the absolute error, and that is judged.
    """
    rows = _compared(evidence, settings, "median")
    passed = int(np.sum(flags(rows, "median_admissible")))
    return f"the median of the neighbours passes in {passed} of {len(rows)} (shown, not judged)"


def _compared(evidence: Evidence, settings: NeedSettings, which: str) -> pd.DataFrame:
    """Held-out two-mode situations in which the mean or the median was checked.

    Raises:
        MissingEvidenceError: It was not, in one of them.
    """
    column = f"{which}_admissible"
    rows = _held_out(evidence, settings)
    rows = rows[flags(rows, "two_mode")]
    if rows[column].isna().any():
        raise MissingEvidenceError(f"the {which} was not checked in every two-mode situation")
    return rows
