"""Looks at chance: noise of the sampler, starts, trainings, and how each moves success."""

import pandas as pd

from gates.diagnosis.looking import Interval, Look, share_of
from gates.evidence import flags, numbers
from gates.reproducibility.settings import MODES
from gates.stress.rollouts import ROLLOUTS, rollouts
from gates.words import percents, share_between
from genpolicy.evidence.rows.need import ModeRow
from genpolicy.evidence.rows.stress import RolloutRow

ONE_NOISE = (
    "how much the sampler's noise alone moves success: each start is played with one stream of it"
)
ONE_TRAINING = "what another training would do: there is one training seed, and so one checkpoint"


def noise_and_starts(look: Look) -> None:
    """Is it the sampler's noise, or are the starts not the same?"""
    look.criteria("B.samples_difference", "B.varied_difference", "D.unmatched_starts")
    look.ask(_starts)
    look.unknown.append(ONE_NOISE)


def training_and_modes(look: Look) -> None:
    """Is it the training, or are modes lost in some of them?"""
    look.criteria("B.late_change_upper", "B.mode_coverage_lower")
    look.ask(_success_by_training)
    look.ask(_coverage_by_training)


def _rollouts(look: Look) -> pd.DataFrame:
    look.rows("D", ROLLOUTS, RolloutRow)
    rows = rollouts(look.reports.evidence, look.reports.settings("D"), look.candidate)
    return rows.assign(won=flags(rows, "success"))


def _starts(look: Look) -> None:
    rows = _rollouts(look)
    starts = rows["start"].nunique()
    states = int(rows.groupby("perturbation")["start_sha256"].nunique().min())
    where = f"{ROLLOUTS}: start_sha256"
    look.number("different states after reset, fewest of a condition", f"{states} of {starts}",
                f"{starts} starts", where)  # fmt: skip
    if states < starts:
        look.causes.append(f"starts repeat: {starts} of them begin in {states} states.")
    won = rows.groupby("start")["won"]
    never, always = int((won.max() == 0).sum()), int((won.min() == 1).sum())
    look.number(
        "starts that fail in every condition, and that succeed in every one",
        f"{never} and {always}", f"{starts} starts", f"{ROLLOUTS}: success, start",
    )  # fmt: skip


def _success_by_training(look: Look) -> None:
    rows = _rollouts(look)
    confidence = look.reports.settings("D").confidence
    found: dict[str, Interval] = {}
    for seed, part in rows.groupby("seed", sort=True):
        share, ends = share_of(part["won"], part["start"], confidence=confidence)
        found[str(seed)] = ends
        look.number(
            f"success of training seed {seed}", share_between(share, *ends),
            f"{part['start'].nunique()} starts", f"{ROLLOUTS}: success, seed",
        )  # fmt: skip
    if len(found) == 1:
        look.unknown.append(ONE_TRAINING)
    worst = min(found, key=lambda name: found[name][1])
    best = max(found, key=lambda name: found[name][0])
    if found[worst][1] < found[best][0]:
        look.causes.append(
            f"trainings differ: seed {worst} succeeds in "
            f"{percents(*found[worst])}, seed {best} in {percents(*found[best])}."
        )


def _coverage_by_training(look: Look) -> None:
    """Only shown: nothing says yet how far trainings may differ in it."""
    for seed, rows in look.rows("B", MODES, ModeRow).groupby("seed"):
        reached = int((numbers(rows, "modes_covered") >= numbers(rows, "modes_present")).sum())
        look.number(
            f"situations of which training seed {seed} reaches every mode, only shown",
            f"{reached} of {len(rows)}", f"{rows['episode_uuid'].nunique()} episodes",
            f"{MODES}: modes_covered",
        )  # fmt: skip
