"""Whether a policy that was brought answers as it did at Gate B, whatever its files say."""

from collections.abc import Iterable

from gates.criterion import Measured
from gates.evidence import Evidence, MissingEvidenceError, flags
from gates.reproducibility.settings import RELOAD
from genpolicy.evidence.rows.brought import AFTER, BEFORE, FixtureAgainRow
from genpolicy.evidence.rows.reproducibility import SampleRow

CHANGED = "changed_answers"
"""Asked of who was brought only: what is trained here is opened by the hash of its weights."""


def changed_since_gate_b(
    evidence: Evidence, folder: str, candidate: str, conditions: Iterable[str]
) -> Measured:
    """Fixtures that were answered otherwise than at Gate B, of all that were asked again.

    Args:
        evidence: What may be read.
        folder: Where the evidence of the gate lies.
        candidate: Who is asked about.
        conditions: What its server was started for; each time it was asked twice.

    Raises:
        MissingEvidenceError: A fixture was not asked again, or none is different and some were not
            answered: nobody knows.
    """
    known = evidence.of(f"{RELOAD}/samples.parquet", SampleRow, candidate)
    expected = dict(zip(known["row"], known["sha256_reloaded"], strict=True))
    rows = evidence.of(f"{folder}/fixtures.parquet", FixtureAgainRow, candidate)
    asked = {
        (condition, when): dict(zip(part["row"], part["sha256"], strict=True))
        for (condition, when), part in rows.groupby(["condition", "when"])
    }
    planned = [(condition, when) for condition in conditions for when in (BEFORE, AFTER)]
    for condition, when in planned:
        if set(asked.get((condition, when), ())) != set(expected):
            raise MissingEvidenceError(f"not all of it was asked again {when} {condition}")
    answered = flags(rows, "answered")
    other = (rows["sha256"] != rows["row"].map(expected)).to_numpy() & answered
    silent = int((~answered).sum())
    if silent and not other.any():
        raise MissingEvidenceError(f"{silent} of {len(rows)} were not answered again")
    text = f"{len(rows) - silent} of {len(rows)} answers, {int(other.sum())} other than at Gate B"
    if other.any():
        first = rows[other].iloc[0]
        text += f", the first one {first['when']} {first['condition']}"
    return Measured(float(other.sum()), caveat=text, counted=f"{len(planned)} times")
