"""Two-mode situations that the audit names: whoever is judged was put before each of them, once.

What a table leaves out cannot be counted, and the situations that were lost are the cheapest to
leave out. Which there are follows from the audit alone: those of the held-out splits in which two
routes persist, the first of each episode and phase.
"""

import pandas as pd

from gates.evidence import Evidence, MissingEvidenceError, numbers
from genpolicy.audit.component_rows import POSITION
from genpolicy.audit.rows import SituationRow

SITUATIONS = "artifacts/audit/neighbourhoods.parquet"
HELD_OUT = ("validation", "test")
"""Splits that train nobody."""
PLACE = ["episode_uuid", "index"]


def named_situations(evidence: Evidence) -> frozenset[tuple[str, int]]:
    """Episode and row of every held-out situation that policies are put before.

    Raises:
        MissingEvidenceError: The audit left no table of situations.
    """
    return evidence.once("two-mode situations", lambda: _named(evidence))


def _named(evidence: Evidence) -> frozenset[tuple[str, int]]:
    rows = evidence.rows(SITUATIONS, SituationRow)
    held = rows["split"].isin(HELD_OUT) & (rows["component"] == POSITION)
    held &= rows["two_mode"].fillna(False).astype(bool)
    held &= rows["persistent"].fillna(False).astype(bool)
    first = rows[held].sort_values(["episode_uuid", "phase", "index"])
    first = first.drop_duplicates(["episode_uuid", "phase"])
    return frozenset(_places(first))


def require_every_situation(
    evidence: Evidence,
    rows: pd.DataFrame,
    who: str,
    *,
    table: str,
    samples: int,
    seeds: tuple[int, ...] | None = None,
) -> None:
    """Each training seed was put before every situation once, and drew as many as planned there.

    Args:
        evidence: The evidence.
        rows: What one policy did by one way of drawing.
        who: It, as a sentence names it.
        table: Path of the table.
        samples: Candidates that are planned in each situation.
        seeds: Training seeds that are planned; those that have rows where None.

    Raises:
        MissingEvidenceError: A situation is left out, stands there twice, or is none of the
            audit's; fewer candidates were drawn, or by fewer trainings.
    """
    named = named_situations(evidence)
    if lacking := sorted(set(seeds or ()) - set(rows["seed"])):
        raise MissingEvidenceError(f"{table} has no rows of {who} of training seed {lacking[0]}")
    for seed, part in rows.groupby("seed"):
        places = _places(part)
        if len(set(places)) != len(places):
            raise MissingEvidenceError(f"{table} has a situation of {who} twice, of seed {seed}")
        if set(places) != named:
            raise MissingEvidenceError(
                f"{table} holds {len(named & set(places))} of the {len(named)} situations that the "
                f"audit names and {len(set(places) - named)} others, of {who}, seed {seed}"
            )
    fewest = int(numbers(rows, "samples").min()) if len(rows) else 0
    if fewest < samples:
        raise MissingEvidenceError(
            f"{table} has a situation in which {who} drew {fewest} candidates; planned are "
            f"{samples}"
        )


def _places(rows: pd.DataFrame) -> list[tuple[str, int]]:
    return list(rows[PLACE].itertuples(index=False, name=None))
