"""Fixtures as training drew them, against what is said to have come back."""

from dataclasses import dataclass

import pandas as pd

from gates.evidence import Evidence, MissingEvidenceError
from gates.reproducibility.settings import GENERATORS, NFE, SAMPLES
from genpolicy.evidence.documents.reproducibility import CandidateIdentity
from genpolicy.evidence.rows.reproducibility import FIXTURES_ON, NfeRow

DRAWN = f"{GENERATORS}/fixtures.parquet"


@dataclass(frozen=True)
class TrainedFixture:
    """`fixtures.parquet` of a training; fields as in `genpolicy.policies.fixtures.FixtureRow`.

    Not that class itself: whatever imports it imports the networks too.
    """

    method: str
    seed: int
    row: int
    checkpoint: str
    sampler: str
    nfe: int
    prediction_horizon: int
    sha256: str
    samples: tuple[float, ...]


def require_as_trained(
    evidence: Evidence, rows: pd.DataFrame, candidate: str, entry: CandidateIdentity
) -> None:
    """What reload held its samples against is what training drew, by these checkpoints.

    Args:
        evidence: The evidence.
        rows: `samples.parquet` of a candidate that was trained here.
        candidate: The candidate.
        entry: Who it is said to be.

    Raises:
        MissingEvidenceError: Other samples, fixtures of another checkpoint or sampler, or other
            evaluations than are said to be recorded.
    """
    drawn = evidence.of(DRAWN, TrainedFixture, candidate)
    on = rows.loc[rows["device"] == FIXTURES_ON, ["seed", "row", "sha256_trained"]]
    known, said = (
        set(part.itertuples(index=False, name=None))
        for part in (drawn[["seed", "row", "sha256"]], on)
    )
    if known != said:
        raise MissingEvidenceError(
            f"{SAMPLES} holds {len(known & said)} of the {len(known)} samples that training drew "
            f"({DRAWN}) and {len(said - known)} others, of {candidate}"
        )
    if not set(drawn["checkpoint"]) <= set(entry.checkpoints) or set(drawn["sampler"]) != {
        entry.sampler
    }:
        raise MissingEvidenceError(f"{DRAWN} is of another checkpoint or sampler of {candidate}")
    recorded = evidence.of(NFE, NfeRow, candidate)[["seed", "recorded"]]
    first = drawn.sort_values("row").drop_duplicates("seed")[["seed", "nfe"]]
    if not set(map(tuple, first.to_numpy())) <= set(map(tuple, recorded.to_numpy())):
        raise MissingEvidenceError(f"{DRAWN} counts other evaluations of {candidate} than {NFE}")
