"""Rollouts to watch, on the desk: which ones, by a rule, and what is said of each."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import pandas as pd

from gates.evidence import Evidence, MissingEvidenceError, flags, numbers
from gates.pages.bound import require_bound
from gates.pages.figures import Small
from gates.pages.reasons import personal
from gates.pipeline import TASK
from gates.report import Gate, GateReport
from gates.stress.rollouts import ROLLOUTS, STRESS
from genpolicy.documents.task import IDENTITY
from genpolicy.errors import GenpolicyError
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.evidence.stress.worth import worth_watching
from genpolicy.tasks.api import load_task

if TYPE_CHECKING:
    from genpolicy.replay.bodies import DrawnCell
    from genpolicy.replay.film import Film

MOST = 6
MOST_SAID = 300
"""Characters of why nothing is shown; a longer text ends in a mark."""
KEPT_FILMS = 16
"""The desk is printed again by every gate; the same journal is not read twice in a process."""


@dataclass(frozen=True)
class Clips:
    """The rollouts to watch, or why there are none.

    Attributes:
        method: Whose they are; the promoted one, or else the candidate that succeeds most.
        promoted: Whether Gate D promotes it.
        shown: Each with its title, what is said of it, and its drawing.
        left_out: What the rule would show besides.
        missing: Why nothing is shown; empty if something is.
    """

    method: str = ""
    promoted: bool = False
    shown: tuple[Small, ...] = ()
    left_out: tuple[str, ...] = ()
    missing: str = ""


def clips_of(reports: Mapping[Gate, GateReport], evidence: Evidence) -> Clips:
    """What of Gate D's rollouts is worth watching, drawn from their journals."""
    report = reports.get("D")
    if report is None:
        return Clips(missing="gate D was not judged, so no method has rolled out")
    try:
        require_bound(evidence, report, ROLLOUTS)
        rows = evidence.rows(ROLLOUTS, RolloutRow)
        method = report.promoted or _best(rows, report)
        chosen = _chosen(rows[rows["method"] == method])
        shown = [
            _clip(evidence, report, row, ", ".join(why), number)
            for number, (row, why) in enumerate(chosen[:MOST], start=1)
        ]
    except (MissingEvidenceError, GenpolicyError, LookupError, ValueError, TypeError) as error:
        return Clips(missing=shorten(str(error), MOST_SAID, placeholder=" …"))
    return Clips(
        method=method,
        promoted=method == report.promoted,
        shown=tuple(shown),
        left_out=tuple(", ".join(why) for _, why in chosen[MOST:]),
    )


def _best(rows: pd.DataFrame, report: GateReport) -> str:
    """The candidate with most successes; of equal ones the first by name."""
    own = rows[rows["method"].isin(list(report.candidates))]
    if own.empty:
        raise MissingEvidenceError("no candidate has rolled out")
    won = pd.Series(flags(own, "success")).groupby(own["method"].to_numpy()).sum()
    return str(won.sort_index().idxmax())


def _chosen(rows: pd.DataFrame) -> list[tuple[pd.Series, list[str]]]:
    """Rollouts and why each is shown, in the order of the rule; one row once, for all its reasons.

    Of each of them stress keeps what its layers refused, since the rule is the same.
    """
    rows = rows.sort_values(["seed", "perturbation", "start"], kind="stable").reset_index(drop=True)
    flags(rows, "success")
    for name in ("duration_s", "force_peak_n"):
        numbers(rows, name)
    ended: list[Any] = list(rows.itertuples())
    found = worth_watching(ended)
    return [(rows.iloc[place], why) for place, why in found.items()]


def _clip(evidence: Evidence, report: GateReport, row: pd.Series, why: str, number: int) -> Small:
    session = f"{row['method']}/{row['perturbation']}/{row['start']}"
    journal = f"{STRESS}/journals/{row['method']}__{row['perturbation']}.mcap"
    require_bound(evidence, report, journal)
    # Only where something is drawn: it loads the simulator.
    from gates.pages.clips_drawn import drawn_clip  # noqa: PLC0415

    task = evidence.document(TASK, IDENTITY).name
    film = _film(evidence.root / journal, report.materials[journal], session, task)
    force = float(row["force_peak_n"])
    touched = f"force at most {force:.3g} N" if force > 0 else "touches nothing"
    ages = [age for _, age in film.ages]
    aged = f", oldest action {personal([max(ages)], 's')}" if ages else ", no action of its own"
    return Small(
        why[0].upper() + why[1:],
        (
            f"{row['perturbation']}, start {row['start']}: "
            f"{str(row['outcome']).replace('_', ' ')} after {row['duration_s']:.3g} s; "
            f"{touched}{aged}.",
            f"genpolicy replay {journal} --session {session} --out watch.mcap",
        ),
        drawn_clip(film, load_task(task).workspace, number, said=why),
    )


@lru_cache(maxsize=KEPT_FILMS)
def _film(journal: Path, digest: str, session: str, task: str) -> "Film":
    """The film of a session; `digest` tells apart what lay under one name at two times."""
    from genpolicy.replay.film import film_of  # noqa: PLC0415  (loads the simulator)
    from genpolicy.replay.journal_file import read_session  # noqa: PLC0415

    found = read_session(journal, session)
    return film_of(_cell(task), [item.event for item in found.events])


@lru_cache(maxsize=1)
def _cell(task: str) -> "DrawnCell":
    from genpolicy.replay.bodies import DrawnCell  # noqa: PLC0415  (loads the simulator)

    return DrawnCell.of(load_task(task))
