"""Modes: how many situations have two that persist, succeed, are feasible, and defeat the mean?"""

import numpy as np
import pandas as pd

from gates.bounds import share_interval
from gates.cause import CauseName
from gates.claim import MEDIAN_PASSES, SHOWN
from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError, flags
from gates.need.cause import as_the_cause, asked, found_cause
from gates.need.settings import AUDIT, NeedSettings
from gates.recount import AtLeast, Subset, all_hold, is_one, part_said
from gates.words import number, share_of
from genpolicy.audit.rows import RecoveryOutcome, SituationRow

SITUATIONS = f"{AUDIT}/neighbourhoods.parquet"
DEFEATED = (AtLeast("modes_admissible", "clusters"), is_one("mean_admissible", False))
"""Of a situation with two modes: each passes, and the mean does not."""


@criterion(
    ">=",
    question="Were enough held-out situations examined?",
    look_at="Multimodality: too little support; record more episodes of the same task.",
)
def held_out_situations(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Held-out situations that were examined."""
    return _support("held_out_situations", evidence, settings)


@criterion(
    ">=",
    question="In how many do two persistent modes exist?",
    look_at="Multimodality: the actions are unimodal here; keep the simpler policy.",
)
def multimodal_situations(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Held-out situations with two clusters that persist."""
    return _support("multimodal_situations", evidence, settings)


def _support(question: str, evidence: Evidence, settings: NeedSettings) -> Measured:
    """A count; below its limit it denies modes only where the cause says that there are none.

    Where there was too little to say, fewer situations than are needed are no refutation.
    """
    found = as_the_cause(question, evidence, settings)
    needed = asked(settings.limits)[question].limit
    if found.value is None or needed is None or found.value - needed >= 0:
        return found
    cause = found_cause(evidence, settings)
    if cause.name is not CauseName.INSUFFICIENT_SUPPORT:
        return found
    text = f"not decided: {found.value:g} of {needed:g} needed; {cause.next_action}"
    return Measured(None, caveat=text)


@criterion(
    ">=",
    question="Does mode identity persist over steps, beyond a shuffled-time null?",
    look_at="Multimodality: this is pointwise noise (tremor, quantisation), not a mode.",
)
def persistence_margin(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Persistence of mode identity above the 95 % quantile of the shuffled-time null."""
    return as_the_cause("persistence_margin", evidence, settings)


@criterion(
    ">=",
    question="Does each mode of a choice succeed?",
    look_at="Multimodality: a mode fails; separate failed and intervention targets.",
)
def mode_success_lower(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Lowest exact lower bound of success over the modes of the best choice."""
    also = _recovered(evidence)
    return as_the_cause("mode_success_lower", evidence, settings, also=also)


def _recovered(evidence: Evidence) -> str:
    """What the disturbed demonstrations did, by mode: shown, never judged."""
    try:
        frame = evidence.rows(f"{AUDIT}/recovery.parquet", RecoveryOutcome)
    except MissingEvidenceError:
        return "no disturbed demonstration is known"
    counts = frame.groupby("mode")[["successes", "episodes"]].sum()
    by_mode = ", ".join(
        f"{mode} {share_of(good, episodes)}"
        for mode, (good, episodes) in zip(counts.index, counts.to_numpy(), strict=True)
    )
    return f"disturbed demonstrations that recovered (shown, not judged): {by_mode}"


@criterion(
    ">=",
    question="Is each mode of a choice feasible in all layers?",
    look_at="Multimodality: a mode breaks limits or collides; it is no valid target.",
)
def mode_feasible_share(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Lowest share of admissible modal chunks over the modes of the best choice."""
    return as_the_cause("mode_feasible_share", evidence, settings)


@criterion(
    ">=",
    question="Is the mean rejected where every mode passes?",
    look_at="Multimodality: the mean action is admissible, so a point policy loses nothing.",
)
def mean_defeated_share(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Lower bound of the share of two-mode situations in which only the mean is rejected."""
    subset, rows = _compared(evidence, settings, "mean")
    if len(rows) == 0:
        return Measured(0.0, caveat="no held-out situation has two modes")
    share, lower, upper = share_interval(
        all_hold(DEFEATED, rows),
        list(rows["episode_uuid"]),
        confidence=settings.confidence,
        favourable=True,
    )
    episodes = rows["episode_uuid"].nunique()
    recount = subset.counted(rows, *DEFEATED)
    text = (
        f"{part_said(recount, 'situations')}; lower bound over "
        f"{number(episodes)} episodes, whose situations are not independent; "
        f"{_median(evidence, settings)}"
    )
    counted = f"{episodes} episodes"
    return Measured(lower, (lower, upper), text, counted=counted, recount=recount, point=share)


def _median(evidence: Evidence, settings: NeedSettings) -> str:
    """How often the point-wise median of the neighbours passes: shown, not judged.

    Of an odd number of plans on two sides, or of unequal sides, the median lies on one of them,
    so wherever each mode is valid it passes: no task with modes could meet a limit on it. What
    learns it is the absolute error, and that is judged.
    """
    _, rows = _compared(evidence, settings, "median")
    passed = int(np.sum(flags(rows, "median_admissible")))
    return f"the {MEDIAN_PASSES} {share_of(passed, len(rows))} ({SHOWN})"


def _compared(
    evidence: Evidence, settings: NeedSettings, which: str
) -> tuple[Subset, pd.DataFrame]:
    """Held-out two-mode situations in which the mean or the median was checked.

    Raises:
        MissingEvidenceError: It was not, in one of them.
    """
    column = f"{which}_admissible"
    splits = is_one("split", *settings.held_out_splits)
    subset = Subset(SITUATIONS, (splits, is_one("two_mode", True)))
    rows = subset.of(evidence.rows(SITUATIONS, SituationRow))
    if rows[column].isna().any():
        raise MissingEvidenceError(f"the {which} was not checked in every two-mode situation")
    return subset, rows
