"""Does the virtual clock tell the truth? The same recorded windows by it and by the wall clock.

Printed and not judged: a busy machine is late by the wall clock, and no candidate is worse for it.
What is said rests on tolerances that were fixed beforehand. Two clocks agree where every interval
lies within its tolerance, differ where one lies outside, and otherwise it cannot be told.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from gates.engine import Judged
from gates.evidence import Evidence, MissingEvidenceError, flags, numbers
from gates.stress.rollouts import StressSettings
from gates.words import points, three
from genpolicy.errors import GenpolicyError
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.rows.clocks import ClockAgeRow, ClockInvocationRow
from genpolicy.seeds import stream
from genpolicy.statistics.two_samples import distance_interval, share_difference

Array = NDArray[np.float64]

WALL_CLOCK = "artifacts/wall_clock"
INVOCATIONS, AGES = f"{WALL_CLOCK}/invocations.parquet", f"{WALL_CLOCK}/ages.parquet"
WALL, VIRTUAL = "wall", "virtual"
AGE, MISSES, DISCARDS, REPLACED = "age_distance", "deadline_misses", "discards", "replacements"
SHARE = "share"
"""Tolerance of everything but ages."""
SHOWN = {
    AGE: "ages of actions", MISSES: "missed deadlines", DISCARDS: "discards",
    REPLACED: "replacements",
}  # fmt: skip
AGREE, DIFFER, UNTOLD, UNSEEN = "agree", "differ", "cannot be told apart or alike", "not looked at"
LEAVES = (
    "The arm of a window goes where the stub's commands lead, exactly and a period late. The scene "
    "does not move with it, forces and phases are those of the recording, and how a rollout ends "
    "was not seen by the wall clock."
)
ALONE = (
    "No chunk took over from one that still had rows, by either clock: how chunks follow each "
    "other while the policy answers was not seen. So it is where a task's arm cannot be followed: "
    "each question begins anew where the recorded arm is."
)
"""Said where that is so of all that was compared."""


@dataclass(frozen=True)
class Difference:
    """One thing that both clocks did.

    Attributes:
        name: What; a reason stands behind a colon.
        wall: By the wall clock: a share; None of ages.
        virtual: By the virtual clock, likewise.
        interval: Of the difference of the two, or of the distance of ages.
        tolerance: What it may be; None where nobody fixed one.
    """

    name: str
    wall: float | None
    virtual: float | None
    interval: tuple[float, float]
    tolerance: float | None

    @property
    def within(self) -> bool:
        """Whether it is shown to be within its tolerance."""
        low, high = self.interval
        return self.tolerance is not None and -self.tolerance <= low <= high <= self.tolerance

    @property
    def outside(self) -> bool:
        """Whether it is shown to be outside."""
        low, high = self.interval
        return self.tolerance is not None and (low > self.tolerance or high < -self.tolerance)

    @property
    def never(self) -> bool:
        """Whether neither clock did it."""
        return self.wall == self.virtual == 0.0


@dataclass(frozen=True)
class Compared:
    """What the two clocks did with one candidate.

    Attributes:
        answer: They agree, differ, it cannot be told, or nobody looked.
        why: In a few words.
        episodes: Independent units.
        differences: All that was compared.
    """

    answer: str
    why: str
    episodes: int = 0
    differences: tuple[Difference, ...] = ()


def compared(evidence: Evidence, settings: StressSettings, candidate: str) -> Compared:
    """The two clocks on the same windows of held-out episodes, for one candidate."""
    try:
        invocations = _warm(evidence.of(INVOCATIONS, ClockInvocationRow, candidate))
        ages = evidence.of(AGES, ClockAgeRow, candidate)
        broken = _broken_rules(evidence, candidate)
    except MissingEvidenceError as error:
        return Compared(UNSEEN, str(error))
    both = [set(invocations[invocations["clock"] == clock]["episode"]) for clock in (WALL, VIRTUAL)]
    episodes = sorted(both[0] & both[1])
    if not episodes:
        return Compared(UNTOLD, "no episode has a warm invocation by both clocks")
    invocations = invocations[invocations["episode"].isin(episodes)]
    try:
        found = [
            _ages(invocations, ages, settings, candidate, episodes),
            *(_shares(invocations, settings, candidate, episodes)),
        ]
    except MissingEvidenceError as error:
        return Compared(UNSEEN, str(error))
    except GenpolicyError as error:
        return Compared(UNTOLD, str(error), len(episodes))
    return _answered(tuple(found), len(episodes), broken)


def clocks_said(judged: Judged) -> Sequence[str]:
    """A sentence of each candidate, for the report, the page and the card."""
    texts = []
    for candidate in judged.candidates:
        found = compared(judged.evidence, judged.settings, candidate)
        if found.answer == UNSEEN:
            texts.append(f"{candidate}: the wall clock was not looked at ({found.why}).")
            continue
        alone = any(item.name == REPLACED and item.never for item in found.differences)
        texts.append(
            f"{candidate}: the virtual clock and the wall clock {found.answer} ({found.why}; "
            f"{found.episodes} episodes). {LEAVES}{f' {ALONE}' if alone else ''}"
        )
    return texts


def _answered(found: tuple[Difference, ...], episodes: int, broken: int) -> Compared:
    outside = [item for item in found if item.outside]
    open_ones = [item for item in found if not item.within]
    if broken:
        return Compared(DIFFER, f"{broken} rules broken by the checker's reading", episodes, found)
    if outside:
        return Compared(DIFFER, "; ".join(map(_said, outside)), episodes, found)
    if open_ones:
        few = f"too few episodes or no tolerance: {'; '.join(map(_said, open_ones))}"
        return Compared(UNTOLD, few, episodes, found)
    return Compared(AGREE, "; ".join(map(_said, found)), episodes, found)


def _said(item: Difference) -> str:
    kind, _, reason = item.name.partition(":")
    name = SHOWN[kind] + (f" as {reason}" if reason else "")
    low, high = item.interval
    said = three if kind == AGE else points  # of ages a distance, of the others shares
    limit = "none fixed" if item.tolerance is None else said(item.tolerance)
    return f"{name} {said(low)} to {said(high)}, tolerance {limit}"


def _warm(rows: pd.DataFrame) -> pd.DataFrame:
    """Without the first invocation of a window, and those that the window's end cut short."""
    return rows[(numbers(rows, "invocation") > 0) & flags(rows, "in_time")]


def _broken_rules(evidence: Evidence, candidate: str) -> int:
    found = evidence.document(WALL_CLOCK, CHECKER)
    names = [f"{candidate}__{clock}.mcap" for clock in (WALL, VIRTUAL)]
    absent = [name for name in names if name not in found.journals]
    if absent:
        raise MissingEvidenceError(f"the checker has not read {', '.join(absent)}")
    return sum(len(found.journals[name].violations) for name in names)


def _ages(
    invocations: pd.DataFrame,
    ages: pd.DataFrame,
    settings: StressSettings,
    candidate: str,
    episodes: list[str],
) -> Difference:
    """Ages in whole periods: a tick that is late by less than half of one is that tick."""
    key = ["clock", "episode", "invocation"]
    kept = ages.merge(invocations[key], on=key)
    periods = np.rint(numbers(kept, "age_s") / settings.action_period_s).astype(int)
    values = np.arange(int(periods.max(initial=0)) + 1)
    clocks, of = kept["clock"].to_numpy(), kept["episode"].to_numpy()
    counts = {
        clock: np.stack(
            [
                (periods[(clocks == clock) & (of == one)][:, None] == values).sum(axis=0)
                for one in episodes
            ]
        ).astype(np.float64)
        for clock in (WALL, VIRTUAL)
    }
    _, low, high = distance_interval(
        counts[WALL], counts[VIRTUAL], confidence=_coverage(settings),
        rng=stream(settings.root_seed, "clocks", candidate, AGE),
    )  # fmt: skip
    return Difference(AGE, None, None, (low, high), settings.tolerance(AGE))


def _shares(
    rows: pd.DataFrame, settings: StressSettings, candidate: str, episodes: list[str]
) -> list[Difference]:
    by = rows["discarded_by"].astype(str)
    asked = {MISSES: flags(rows, "missed"), REPLACED: flags(rows, "replaced")}
    asked[DISCARDS] = (by != "").to_numpy()
    for reason in sorted({*by} - {""}):
        asked[f"{DISCARDS}:{reason}"] = (by == reason).to_numpy()
    found = []
    for name, hits in asked.items():
        counted = {clock: _per_episode(rows, hits, clock, episodes) for clock in (WALL, VIRTUAL)}
        _, low, high = share_difference(
            counted[WALL], counted[VIRTUAL], confidence=_coverage(settings),
            rng=stream(settings.root_seed, "clocks", candidate, name),
        )  # fmt: skip
        shares = [float(counted[c][0].sum() / counted[c][1].sum()) for c in (WALL, VIRTUAL)]
        found.append(Difference(name, shares[0], shares[1], (low, high), settings.tolerance(SHARE)))
    return found


def _per_episode(
    rows: pd.DataFrame, hits: NDArray[np.bool_], clock: str, episodes: list[str]
) -> tuple[Array, Array]:
    """Hits and rows of each episode, in order. Shape (n,) each."""
    own = (rows["clock"] == clock).to_numpy()
    at = np.searchsorted(np.array(episodes), rows["episode"].to_numpy()[own].astype(str))
    part, whole = np.zeros(len(episodes)), np.zeros(len(episodes))
    np.add.at(part, at, hits[own].astype(np.float64))
    np.add.at(whole, at, 1.0)
    return part, whole


def _coverage(settings: StressSettings) -> float:
    """Two one-sided tests, each at what the confidence leaves."""
    return 2.0 * settings.confidence - 1.0
