"""The sampled chunks: how many the six layers admit, by mode, and what projection did to them."""

import numpy as np
import pandas as pd

from gates.asked_for import REFUSED_FOR
from gates.bounds import counted_interval, share_interval, upper_quantile, widest_gap
from gates.criterion import Measured, criterion
from gates.evidence import Array, Evidence, MissingEvidenceError, flags, numbers
from gates.feasibility.settings import (
    CANDIDATES,
    HELD_OUT,
    INTACT,
    LAYERS,
    NO_MODE,
    PASSED,
    REASONS,
    TWO_MODES,
    UNKNOWN,
    FeasibilitySettings,
)
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.statistics.intervals import clopper_pearson

ODD_SHARE = 0.125
"""One sample of eight, as at Gate B: what fewer episodes come by is a mode by luck."""


def _rows(evidence: Evidence, candidate: str) -> pd.DataFrame:
    return evidence.of(CANDIDATES, CandidateRow, candidate)


def _held_out(evidence: Evidence, candidate: str) -> pd.DataFrame:
    rows = _rows(evidence, candidate)
    rows = rows[rows["fixture"] == HELD_OUT]
    if len(rows) == 0:
        raise MissingEvidenceError("no held-out observation was sampled")
    return rows


def episodes_of(rows: pd.DataFrame) -> pd.Series:
    """Episode of each row: a situation is named by its episode and a step of it."""
    found: pd.Series = rows["situation"].astype(str).str.rpartition(":")[0]
    return found


def admissible(rows: pd.DataFrame) -> Array:
    """1.0 where a candidate passed all six layers; one not reached or unknown is not passed."""
    passed = np.array(rows["outcome"] == PASSED, dtype=np.bool_)
    for layer in LAYERS:
        passed &= flags(rows, layer)
    return passed.astype(np.float64)


def _unknown(rows: pd.DataFrame) -> str:
    """How many of some candidates could not be judged, as the end of a caveat."""
    count = int((rows["outcome"] == UNKNOWN).sum())
    return f"; {count} unknown, which is not passed"


@criterion(
    "<=",
    question="Do the checks treat the modes alike, or remove one?",
    look_at="Conditioning: one mode is outside the feasible set; look at raw samples by mode.",
    per_candidate=True,
)
def mode_admissible_gap(
    evidence: Evidence, settings: FeasibilitySettings, candidate: str
) -> Measured:
    """Upper bound of the largest difference between modes in the share that is admissible.

    Modes with too few episodes to be compared leave it open, unless surely hardly any episode is
    answered in one of them: then they are odd chunks, and are named and left out.
    """
    rows = _rows(evidence, candidate)
    rows = rows[rows["fixture"] == TWO_MODES]
    if len(rows) == 0:
        raise MissingEvidenceError("no situation with several modes was sampled")
    rows = rows.assign(admissible=admissible(rows), episode=episodes_of(rows))
    rows = rows[~rows["mode"].isin(NO_MODE)]
    odd, said = _odd(rows, settings)
    rows = rows[~rows["mode"].isin(odd)]
    rows = rows[rows.groupby("observation")["mode"].transform("nunique") >= 2]
    by_mode = {str(mode): part for mode, part in rows.groupby("mode")}
    seen = {mode: part["episode"].nunique() for mode, part in by_mode.items()}
    if not seen:  # an observation that is left was answered in two
        raise MissingEvidenceError("no observation was answered in two modes")
    if min(seen.values()) < settings.mode_observations:
        rare = ", ".join(f"{mode} {count}" for mode, count in seen.items())
        raise MissingEvidenceError(
            f"observations answered in several modes: {rare}; "
            f"at least {settings.mode_observations} of each are needed{said}"
        )
    shares = {m: (p["admissible"].to_numpy(), p["episode"].tolist()) for m, p in by_mode.items()}
    interval, more, less = widest_gap(shares, confidence=settings.confidence)
    text = ", ".join(f"{m} {p['admissible'].mean():.4g} of {seen[m]}" for m, p in by_mode.items())
    text += f" episodes answered in several modes; upper bound of {more} minus {less}{said}"
    counted = f"{min(seen.values())} episodes of the rarer mode"
    gap = float(np.mean(shares[more][0]) - np.mean(shares[less][0]))
    return Measured(interval[1], interval, text, counted=counted, point=gap)


def _odd(rows: pd.DataFrame, settings: FeasibilitySettings) -> tuple[list[str], str]:
    """Modes of too few episodes that surely few episodes come by, all together; and their names.

    Whether a mode of the task is sampled at all is asked at Gate B. What the checks do to one that
    three chunks of a thousand take, nobody can tell and nothing rests on.
    """
    of_mode = rows.groupby("mode")["episode"].agg(lambda episodes: sorted(set(episodes)))
    few = {str(m): own for m, own in of_mode.items() if len(own) < settings.mode_observations}
    touched = len({episode for own in few.values() for episode in own})
    most = clopper_pearson(touched, rows["episode"].nunique(), settings.confidence)[1]
    if not few or not most <= ODD_SHARE:
        return [], ""
    named = ", ".join(f"{mode} in {len(own)}" for mode, own in few.items())
    return list(few), f"; left out: {named} episodes, together at most {most:.3g} of all"


@criterion(
    ">=",
    question="What share of held-out candidates passes all six layers?",
    look_at="Feasibility: read the rejection waterfall from the first layer down.",
    per_candidate=True,
)
def admissible_share(evidence: Evidence, settings: FeasibilitySettings, candidate: str) -> Measured:
    """Lower bound of the share of held-out candidates that pass all six layers."""
    rows = _held_out(evidence, candidate)
    episodes = episodes_of(rows)
    share, lower, upper = share_interval(
        admissible(rows), episodes.to_numpy(), confidence=settings.confidence, favourable=True
    )
    text = (
        f"share {share:.4g} of {len(rows)} candidates at {rows['observation'].nunique()} "
        f"observations; lower bound over {episodes.nunique()} episodes, whose observations are "
        f"not independent{_unknown(rows)}"
    )
    counted = f"{episodes.nunique()} episodes"
    return Measured(lower, (lower, upper), text, counted=counted, point=share)


@criterion(
    "<=",
    question="How far does projection move an admitted chunk?",
    look_at="Feasibility: projection repairs too much; compare raw samples with the limits.",
    per_candidate=True,
)
def projection_p95_m(evidence: Evidence, settings: FeasibilitySettings, candidate: str) -> Measured:
    """Upper bound of the move by projection that 95 % of the admissible candidates keep, m."""
    return _of_admissible(evidence, settings, candidate, "position_change_m")


@criterion(
    "<=",
    question="How hard is the boundary between two chunks?",
    look_at="Timing: look at H_e, re-planning, blending and normalisation.",
    per_candidate=True,
)
def boundary_jerk_p95_m_s3(
    evidence: Evidence, settings: FeasibilitySettings, candidate: str
) -> Measured:
    """Upper bound of the jerk at the boundary that 95 % of the admissible keep, m/s^3."""
    return _of_admissible(evidence, settings, candidate, "boundary_jerk_m_s3")


def _of_admissible(
    evidence: Evidence, settings: FeasibilitySettings, candidate: str, column: str
) -> Measured:
    rows = _held_out(evidence, candidate)
    rows = rows[admissible(rows) == 1.0]
    if len(rows) == 0:
        raise MissingEvidenceError("no candidate is admissible")
    values = np.abs(numbers(rows, column))
    episodes = episodes_of(rows)
    point, interval = upper_quantile(
        values,
        episodes.to_numpy(),
        0.95,
        confidence=settings.confidence,
        rng=settings.draws("C", column, candidate),
    )
    text = (
        f"p95 {point:.4g}, largest {values.max():.4g}; {len(rows)} admissible candidates of "
        f"{rows['observation'].nunique()} held-out observations in {episodes.nunique()} episodes"
    )
    counted = f"{episodes.nunique()} episodes"
    return Measured(interval[1], interval, text, counted=counted, point=point)


@criterion(
    ">=",
    question="Is every corrupted fixture refused, with a reason?",
    look_at="Feasibility: a layer lets a corrupted input through; see which fixture.",
    per_candidate=True,
)
def corrupted_refused_share(
    evidence: Evidence, settings: FeasibilitySettings, candidate: str
) -> Measured:
    """Share of corrupted candidates that are refused with one of the known reasons."""
    rows = _rows(evidence, candidate)
    rows = rows[~rows["fixture"].isin(INTACT)]
    absent = sorted(set(settings.required_fixtures) - set(rows["fixture"]))
    if absent:
        raise MissingEvidenceError(f"corrupted fixtures not tried: {', '.join(absent)}")
    named = rows["first_reason"].isin(REASONS).to_numpy()
    refused = (admissible(rows) == 0.0) & named
    interval = counted_interval(
        float(refused.sum()), float(len(rows)), confidence=settings.confidence
    )
    through = sorted(set(rows.loc[~refused, "fixture"]))
    text = f"{len(rows)} candidates of {rows['fixture'].nunique()} corrupted fixtures" + (
        f"; let through or refused without reason: {', '.join(through)}" if through else ""
    )
    own = rows["first_reason"] == rows["fixture"].map(REFUSED_FOR)
    text += f"; {int((refused & ~own).sum())} refused for another reason than their fixture's own"
    counted = f"{refused.sum()} of {len(rows)} candidates"
    return Measured(float(refused.mean()), interval, text, counted=counted)
