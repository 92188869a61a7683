"""Looks at modes: what tells them, what lies between, what projection and checks do to them."""

import math

import pandas as pd

from gates.diagnosis.looking import Interval, Look, p95_of, share_of
from gates.evidence import MissingEvidenceError, counts, flags, numbers
from gates.feasibility.candidates import admissible
from gates.feasibility.settings import CANDIDATES, HELD_OUT, NO_MODE
from gates.need.settings import MEASURED
from gates.reproducibility.settings import COVERAGE, RELOAD
from gates.stress.rollouts import NOMINAL, ROLLOUTS, rollouts
from gates.words import length, percent, percents, share_between, span
from genpolicy.evidence.documents.reproducibility import CANDIDATES as IDENTITIES
from genpolicy.evidence.rows.need import ModeRow
from genpolicy.evidence.rows.reproducibility import CoverageRow
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.evidence.rows.stress import RolloutRow

SELECTOR_UNSEEN = (
    "whether the selector knows more than its candidates stands in no table: the order of imports "
    "keeps the future and the evaluator from the selectors of this code, and nothing here looks "
    "into one that was brought"
)


def modes_of_condition(look: Look) -> None:
    """Do the modes answer to the task, or to something that the policy is not told?"""
    look.shown("B.mode_coverage_lower")
    look.criteria(
        "A.strata_effect", "A.told_share", "A.phase_collapse_share", "A.latent_dependence_p"
    )
    look.ask(_success_by_mode)


def feasibility_and_selector(look: Look) -> None:
    """Are the samples infeasible, or chosen badly?"""
    look.criteria(
        "C.admissible_share", "C.mode_admissible_gap", "D.rejection_share_upper",
        "C.checker_violations",
    )  # fmt: skip
    look.ask(_reasons)
    look.ask(_selector)
    look.unknown.append(SELECTOR_UNSEEN)


def alignment_and_hidden_state(look: Look) -> None:
    """Are streams shifted against each other, or is a variable hidden?"""
    look.shown("B.outside_modes_upper")
    look.criteria(
        "A.clock_residual_s", "A.lag_spread_rows", "A.calibration_residual_m", "A.data_defects",
        "A.strata_effect", "A.told_share", "A.phase_collapse_share",
    )  # fmt: skip
    # A question to the data that an owner waived is in no number of these.
    look.unknown.extend(look.reports.not_asked("A.unasked_checks", look.candidate))


def simpler_policies(look: Look) -> None:
    """Do chunked BC or ACT act between the modes as well, or not at all?"""
    look.criteria(
        "A.chunking_valid_share", "A.remedy_valid_share", "A.latent_dependence_p",
        "A.baseline_mode_coverage",
    )  # fmt: skip
    look.ask(_between_of_baselines)
    look.ask(_between_by_nfe)


def raw_samples(look: Look) -> None:
    """Where do the raw samples lie, before anything repairs them?"""
    look.shown("C.projection_p95_m")
    look.criteria("B.outside_modes_upper", "B.mode_coverage_lower")
    look.ask(_moved)
    look.ask(_reasons)


def feasible_conditioning(look: Look) -> None:
    """Is one mode outside what the robot can do, or is the representation wrong?"""
    look.criteria(
        "C.admissible_share", "C.mode_admissible_gap", "A.mode_feasible_share", "B.conformance"
    )
    look.ask(_representation)
    look.ask(_projection_by_mode)


def _success_by_mode(look: Look) -> None:
    """Undisturbed, is there a mode that surely stays below the limit while another does not?"""
    look.rows("D", ROLLOUTS, RolloutRow)
    settings = look.reports.settings("D")
    rows = rollouts(look.reports.evidence, settings, look.candidate)
    rows = rows.assign(won=flags(rows, "success"))[rows["perturbation"] == NOMINAL]
    found: dict[str, Interval] = {}
    for mode, part in _by_mode(rows):
        share, ends = share_of(part["won"], part["start"], confidence=settings.confidence)
        found[mode] = ends
        look.number(
            f"success of undisturbed rollouts in mode {mode}",
            share_between(share, *ends),
            f"{part['start'].nunique()} starts",
            f"{ROLLOUTS}: success, by mode",
        )
    _without_mode(look, rows, settings.confidence)
    if not found:
        raise MissingEvidenceError(f"no undisturbed rollout of {look.candidate} is told by a mode")
    least = settings.limits.number("nominal_success_lower", otherwise=0.0)
    for less in (mode for mode, ends in found.items() if ends[1] < least):
        for more in (mode for mode, ends in found.items() if ends[0] > found[less][1]):
            look.causes.append(
                f"mode {less} fails where mode {more} succeeds: {percents(*found[less])} against "
                f"{percents(*found[more])}, required {percent(least)}."
            )


def _without_mode(look: Look, rows: pd.DataFrame, confidence: float) -> None:
    """Rollouts that stand beside the modes: those that the shares of the modes do not count."""
    part = rows[rows["mode"].isin(NO_MODE)]
    value = f"{len(part)} of {len(rows)}"
    if len(part):
        share, ends = share_of(part["won"], part["start"], confidence=confidence)
        value += f"; success {share_between(share, *ends)}"
    look.number(
        "undisturbed rollouts that belong to no mode", value, f"{part['start'].nunique()} starts",
        f"{ROLLOUTS}: mode, success",
    )  # fmt: skip


def _moved(look: Look) -> None:
    """How many raw samples projection moved, those included that a layer refused."""
    rows = look.rows("C", CANDIDATES, CandidateRow)
    rows = rows[rows["fixture"] == HELD_OUT]
    reached = rows[rows["position_change_m"].notna()]
    where = f"{CANDIDATES}: position_change_m, {HELD_OUT}"
    seen = f"{rows['observation'].nunique()} observations"
    if len(reached) < len(rows):
        never = f"{len(rows) - len(reached)} of {len(rows)}"
        look.number("held-out candidates that never came to projection", never, seen, where)
    for what, part in (
        ("held-out candidates", reached),
        ("refused held-out candidates", reached[admissible(reached) == 0.0]),
    ):
        moved = int((numbers(part, "position_change_m") > 0).sum())
        look.number(f"{what} moved by projection", f"{moved} of {len(part)}", seen, where)


def _representation(look: Look) -> None:
    """Does the representation alone refuse more than may be refused in all?"""
    settings = look.reports.settings("C")
    rows = look.rows("C", CANDIDATES, CandidateRow)
    rows = rows[(rows["fixture"] == HELD_OUT) & rows["representation"].notna()]
    if len(rows) == 0:
        raise MissingEvidenceError(f"no held-out candidate of {look.candidate} reached a layer")
    refused = pd.Series(~flags(rows, "representation"), index=rows.index)
    share, ends = share_of(refused, _episodes(rows), confidence=settings.confidence)
    look.number(
        "held-out candidates refused by the representation layer",
        f"{int(refused.sum())} of {len(rows)}: {share_between(share, *ends)}",
        f"{_episodes(rows).nunique()} episodes", f"{CANDIDATES}: representation, {HELD_OUT}",
    )  # fmt: skip
    most = 1.0 - settings.limits.number("admissible_share", otherwise=0.0)
    if ends[0] > most:
        look.causes.append(
            "the representation is wrong for the robot: its layer alone refuses "
            f"{percents(*ends)}, and all layers together may refuse {percent(most)}."
        )


def _reasons(look: Look) -> None:
    rows = look.rows("C", CANDIDATES, CandidateRow)
    rows = rows[rows["fixture"] == HELD_OUT]
    bad = rows[admissible(rows) == 0.0]
    where = f"{CANDIDATES}: outcome, first_reason, {HELD_OUT}"
    seen = f"{rows['observation'].nunique()} observations"
    look.number("held-out candidates refused", f"{len(bad)} of {len(rows)}", seen, where)
    for reason, count in bad["first_reason"].value_counts().head(3).items():
        look.number(f"first refused by {reason}", f"{count} of {len(bad)}", seen, where)


def _selector(look: Look) -> None:
    look.rows("B", f"{RELOAD}/modes.parquet", ModeRow)
    entry = look.reports.evidence.document(RELOAD, IDENTITIES).get(look.candidate)
    if entry is None:
        raise MissingEvidenceError(f"{RELOAD}/{IDENTITIES.file} has no entry of {look.candidate}")
    where = f"{RELOAD}/{IDENTITIES.file}: card.selector"
    said = f"{entry.card.selector}, of {entry.card.candidates} candidates"
    look.number("who chooses among the samples", said, "the identity card", where)


def _between_of_baselines(look: Look) -> None:
    path = f"{MEASURED}/modes.parquet"
    frame = look.rows("A", path, ModeRow, all_methods=True)
    for method, part in frame.groupby("method", sort=True):
        between, drawn = counts(part, "between_modes").sum(), numbers(part, "samples").sum()
        look.number(
            f"samples of {method} between two modes", f"{between:g} of {drawn:g}",
            f"{part['episode_uuid'].nunique()} episodes", f"{path}: between_modes",
        )  # fmt: skip


def _between_by_nfe(look: Look) -> None:
    rows = look.rows("B", COVERAGE, CoverageRow)
    rows = rows.assign(between=numbers(rows, "between_share"))
    by_nfe = rows.groupby("nfe", sort=True)["between"].mean()
    shares = [f"{percent(share)} at {nfe}" for nfe, share in by_nfe.items()]
    look.number(
        "share between two modes, by network evaluations", ", ".join(shares),
        f"{int(numbers(rows, 'situations').max())} situations", f"{COVERAGE}: between_share",
    )  # fmt: skip


def _projection_by_mode(look: Look) -> None:
    settings = look.reports.settings("C")
    rows = look.rows("C", CANDIDATES, CandidateRow)
    rows = rows[(rows["fixture"] == HELD_OUT) & (admissible(rows) == 1.0)]
    found: dict[str, Interval] = {}
    beside = int(rows["mode"].isin(NO_MODE).sum())
    where = f"{CANDIDATES}: mode"
    look.number("admitted candidates that belong to no mode", f"{beside} of {len(rows)}", "", where)
    for mode, part in _by_mode(rows):
        moved = part["position_change_m"].astype(float)
        episodes = _episodes(part)
        rng = settings.draws("diagnosis", "projection", look.candidate, mode)
        point, ends = p95_of(moved, episodes, confidence=settings.confidence, rng=rng)
        found[mode] = ends
        look.number(
            f"p95 of the move by projection in mode {mode}",
            f"{length(point)} ({_lengths(ends)})",
            f"{episodes.nunique()} episodes, {len(part)} admitted candidates",
            f"{CANDIDATES}: position_change_m, by mode",
        )
    most = settings.limits.number("projection_p95_m", otherwise=math.inf)
    for more in (mode for mode, ends in found.items() if ends[0] > most):
        for less in (mode for mode, ends in found.items() if ends[1] <= most):
            look.causes.append(
                f"projection moves mode {more} beyond the limit and mode {less} not: "
                f"{_lengths(found[more])} against {_lengths(found[less])}, at most {length(most)}."
            )


def _episodes(rows: pd.DataFrame) -> pd.Series:
    """Episode of each row: a situation is named by its episode and a step of it."""
    found: pd.Series = rows["situation"].astype(str).str.rpartition(":")[0]
    return found


def _by_mode(rows: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    told = rows[~rows["mode"].isin(NO_MODE)]
    return [(str(mode), part) for mode, part in told.groupby("mode", sort=True)]


def _lengths(ends: Interval) -> str:
    return span(length(ends[0]), length(ends[1]))
