"""The sampled chunks: how many the six layers admit, by mode, and what projection did to them."""

from collections.abc import Callable

import numpy as np
import pandas as pd

from gates.asked_for import REFUSED_FOR
from gates.bounds import counted_interval, share_interval, upper_quantile, widest_gap
from gates.criterion import Measured, criterion
from gates.doubt import NEVER_ASKED
from gates.evidence import Array, Evidence, MissingEvidenceError, numbers
from gates.feasibility.margins import require_consistent
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
from gates.recount import NotAll, Subset, all_hold, is_none, is_one, part_said
from gates.words import length, number, percent, share_of, three
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.statistics.intervals import clopper_pearson

ODD_SHARE = 0.125
"""One sample of eight, as at Gate B: what fewer episodes come by is a mode by luck."""
ADMISSIBLE = (is_one("outcome", PASSED), *(is_one(layer, True) for layer in LAYERS))
"""Of a candidate that passed all six layers."""
HELD_OUT_ROWS = Subset(CANDIDATES, (is_one("fixture", HELD_OUT),))
CORRUPTED_ROWS = Subset(CANDIDATES, (is_none("fixture", *INTACT),))
REFUSED_BY_NAME = (NotAll(ADMISSIBLE), is_one("first_reason", *REASONS))


def _rows(evidence: Evidence, candidate: str) -> pd.DataFrame:
    return evidence.once(
        ("candidates", candidate),
        lambda: require_consistent(evidence.of(CANDIDATES, CandidateRow, candidate)),
    )


def _held_out(evidence: Evidence, candidate: str) -> pd.DataFrame:
    # Most measures of the gate ask for them.
    rows = evidence.once(
        ("held out", candidate), lambda: HELD_OUT_ROWS.of(_rows(evidence, candidate))
    )
    if len(rows) == 0:
        raise MissingEvidenceError("no held-out observation was sampled")
    return rows


def episodes_of(rows: pd.DataFrame) -> pd.Series:
    """Episode of each row: a situation is named by its episode and a step of it."""
    found: pd.Series = rows["situation"].astype(str).str.rpartition(":")[0]
    return found


def admissible(rows: pd.DataFrame) -> Array:
    """1.0 where a candidate passed all six layers; one not reached or unknown is not passed."""
    return all_hold(ADMISSIBLE, rows).astype(np.float64)


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
    text = ", ".join(
        f"{m} {share_of(p['admissible'].sum(), len(p), 'candidates')} of {seen[m]} episodes"
        for m, p in by_mode.items()
    )
    text += f", that are answered in several modes; upper bound of {more} minus {less}{said}"
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
    parts = {mode: rows[rows["mode"] == mode]["admissible"] for mode in few}
    named = ", ".join(
        f"{mode} in {len(few[mode])} episodes "
        f"({int(part.sum()) or 'none'} of {len(part)} candidates admissible)"
        for mode, part in parts.items()
    )
    return list(few), f"; left out: {named}, together at most {percent(most)} of all"


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
    recount = HELD_OUT_ROWS.counted(rows, *ADMISSIBLE)
    text = (
        f"{part_said(recount, 'candidates')} at "
        f"{number(rows['observation'].nunique())} observations; lower bound over "
        f"{number(episodes.nunique())} episodes, whose observations are not "
        f"independent{_unknown(rows)}"
    )
    counted = f"{episodes.nunique()} episodes"
    return Measured(lower, (lower, upper), text, counted=counted, recount=recount, point=share)


@criterion(
    "<=",
    question="How far does projection move an admitted chunk?",
    look_at="Feasibility: projection repairs too much; compare raw samples with the limits.",
    per_candidate=True,
)
def projection_p95_m(evidence: Evidence, settings: FeasibilitySettings, candidate: str) -> Measured:
    """Upper bound of the move by projection that 95 % of the admissible candidates keep, m."""
    return _of_admissible(evidence, settings, candidate, "position_change_m", length)


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
    return _of_admissible(evidence, settings, candidate, "boundary_jerk_m_s3", _jerk)


def _jerk(value_m_s3: float) -> str:
    return f"{three(value_m_s3)} m/s^3"


def _of_admissible(
    evidence: Evidence,
    settings: FeasibilitySettings,
    candidate: str,
    column: str,
    said: Callable[[float], str],
) -> Measured:
    subset = Subset(CANDIDATES, (*HELD_OUT_ROWS.terms, *ADMISSIBLE))
    rows = subset.of(_held_out(evidence, candidate))
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
        f"95 % are at most {said(point)}, the largest is {said(values.max())}; "
        f"{number(len(rows))} admissible candidates of {number(rows['observation'].nunique())} "
        f"held-out observations in {number(episodes.nunique())} episodes"
    )
    counted = f"{episodes.nunique()} episodes"
    recount = subset.counted(rows)
    return Measured(interval[1], interval, text, counted=counted, recount=recount, point=point)


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
    rows = CORRUPTED_ROWS.of(_rows(evidence, candidate))
    absent = sorted(set(settings.required_fixtures) - set(rows["fixture"]))
    if absent:
        raise MissingEvidenceError(f"corrupted fixtures not tried: {', '.join(absent)}")
    refused = all_hold(REFUSED_BY_NAME, rows)
    interval = counted_interval(
        float(refused.sum()), float(len(rows)), confidence=settings.confidence
    )
    through = sorted(set(rows.loc[~refused, "fixture"]))
    text = f"{number(len(rows))} candidates of {rows['fixture'].nunique()} corrupted fixtures" + (
        f"; let through or refused without reason: {', '.join(through)}" if through else ""
    )
    own = rows["first_reason"] == rows["fixture"].map(REFUSED_FOR)
    text += f"; {int((refused & ~own).sum())} refused for another reason than their fixture's own"
    never = sorted(set(rows["fixture"]) - set(rows.loc[own, "fixture"]))
    text += f"; {NEVER_ASKED}{', '.join(never)}" if never else ""
    counted = f"{refused.sum()} of {len(rows)} candidates"
    recount = CORRUPTED_ROWS.counted(rows, *REFUSED_BY_NAME)
    return Measured(float(refused.mean()), interval, text, counted=counted, recount=recount)
