"""Fixtures asked for in another way: does a sample depend on anything but its name?

Of whoever computes on another device than the CPU, or in less than single precision, a batch of
another size is measured and not judged: such libraries pick another kernel for it, and its rounding
is no other policy. What is trained here, and whoever has full precision on the CPU, is held to all.
"""

import numpy as np
import pandas as pd

from gates.claim import trainings
from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError, counts, numbers
from gates.reproducibility.settings import (
    BROUGHT_FOLDER,
    RELOAD,
    ReproducibilitySettings,
    fixtures_of,
)
from genpolicy.contract.action import ACTION_COMPONENTS
from genpolicy.evidence.documents.brought import BROUGHT
from genpolicy.evidence.documents.conformance import CONFORMANCE
from genpolicy.evidence.documents.reproducibility import CANDIDATES as IDENTITIES
from genpolicy.evidence.rows.reproducibility import (
    ALONE,
    FIXTURES_ON,
    THREADS,
    TOGETHER,
    VARIATIONS,
    VariationRow,
)

VARIED = f"{RELOAD}/variations.parquet"
PLAINLY = 2
"""Chunks that one observation is asked for at once, as fixtures always are."""
COMPANY = 2 * PLAINLY
"""Chunks that one observation is asked for at once where it stands beside others than usually."""
OBEYS = ("torch", "onnx")
"""Kinds of programs whose threads are set and not asked for."""
BATCH = (ALONE, TOGETHER)
FULL = ("float32", "float64")
"""Precisions in which a batch of another size rounds by less than the limit."""


@criterion(
    "<=",
    question="Is a sample the same with other threads, in another batch and in another order?",
    look_at="Sampler: a sample depends on its company, on its turn or on the threads.",
    per_candidate=True,
    always=True,
)
def varied_difference(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Largest difference of a sample that was asked for in another way, in its own unit."""
    rows = evidence.of(VARIED, VariationRow, candidate)
    known = rows[rows["unknown"] == ""]
    brought = candidate in settings.brought
    _require_whole(rows, fixtures_of(evidence, candidate))
    _require_asked(rows, _cannot(evidence, candidate) if brought else ())
    apart = np.abs(numbers(known, "max_abs_difference"))
    unequal = counts(known, "unequal")
    if np.any((unequal > 0) != (apart > 0)):
        raise MissingEvidenceError("chunks differ by nothing, or do not and differ by something")
    batched = _other_kernels(evidence, candidate) if brought else ""
    judged = ~known["variation"].isin(BATCH if batched else ()).to_numpy()
    known, measured, told = known[judged], apart[judged], known[~judged]
    largest = known.iloc[int(measured.argmax())]
    parts = [
        f"{way} {_unequal(part)}"
        for way, part in rows.groupby("variation", sort=False)
        if not (part["unknown"] != "").any()
    ]
    text = f"chunks not bit-equal, {trainings(rows['seed'].nunique())}: {', '.join(parts)}"
    if measured.max() > 0.0:
        text += f"; most by {largest['variation']}, in {largest['component']}"
    for way, part in rows[rows["unknown"] != ""].groupby("variation", sort=False):
        text += f"; unknown by {way}: {part['unknown'].iloc[0]}"
    for way, part in told.groupby("variation", sort=False):
        text += f"; not judged, {batched}: {way} {part['max_abs_difference'].abs().max():.3g}"
    if not brought:
        text += "; it takes one thread whatever is set, so that threads show no more than that"
    return Measured(float(measured.max()), caveat=text)


def _other_kernels(evidence: Evidence, candidate: str) -> str:
    """Why another batch is no other question to it; empty where it is.

    Raises:
        MissingEvidenceError: Nobody says where it runs.
    """
    found = evidence.document(RELOAD, IDENTITIES).get(candidate)
    if found is None:
        raise MissingEvidenceError(f"{RELOAD}/{IDENTITIES.file} has no entry of {candidate}")
    device, precision = found.card.device, found.card.precision
    if device == FIXTURES_ON and precision in ("", *FULL):
        return ""
    return f"as a batch may pick another kernel on {device} in {precision or 'no said precision'}"


def _cannot(evidence: Evidence, candidate: str) -> tuple[str, ...]:
    """Ways in which one that was brought cannot be asked, by its entry and what it says it can.

    Raises:
        MissingEvidenceError: Neither is there.
    """
    entry = evidence.document(BROUGHT_FOLDER, BROUGHT).get(candidate)
    told = evidence.document(RELOAD, CONFORMANCE).get(candidate)
    if entry is None or told is None:
        raise MissingEvidenceError(f"nobody says what {candidate} can be asked")
    threads = () if entry.kind in OBEYS else (THREADS,)
    if not entry.stochastic or told.most_candidates < PLAINLY:
        return (*threads, *BATCH)
    return threads if told.most_candidates >= COMPANY else (*threads, TOGETHER)


def _require_whole(rows: pd.DataFrame, fixtures: dict[int, int]) -> None:
    """Every component of every way, once, of every training seed, and of every fixture.

    Raises:
        MissingEvidenceError: It is not whole.
    """
    if set(rows["seed"]) != set(fixtures):
        raise MissingEvidenceError(f"{VARIED} does not hold each training seed that was drawn")
    whole = {(way, component) for way in VARIATIONS for component in ACTION_COMPONENTS}
    for seed, part in rows.groupby("seed"):
        found = list(zip(part["variation"], part["component"], strict=True))
        if len(found) != len(whole) or set(found) != whole:
            raise MissingEvidenceError(f"{VARIED} does not hold each way once, of seed {seed}")
    compared = counts(rows, "chunks")
    ways = zip(rows["seed"], rows["variation"], rows["unknown"], compared, strict=True)
    for seed, way, unknown, chunks in ways:
        asked = fixtures[int(seed)] * (1 if way == ALONE else PLAINLY)
        if chunks != (0 if unknown else asked):
            raise MissingEvidenceError(
                f"{chunks:g} chunks were compared by {way} of seed {seed}, of {asked}"
            )


def _require_asked(rows: pd.DataFrame, cannot: tuple[str, ...]) -> None:
    """Nothing is unknown that could have been asked.

    Raises:
        MissingEvidenceError: Something is.
    """
    for way, part in rows[rows["unknown"] != ""].groupby("variation", sort=False):
        if way not in cannot:
            raise MissingEvidenceError(
                f"by {way} it can be asked, and was not: {part['unknown'].iloc[0]}"
            )


def _unequal(part: pd.DataFrame) -> str:
    """Of one way: the most chunks that differ in one component, of all training seeds."""
    by_component = part.groupby("component")[["unequal", "chunks"]].sum()
    return f"{int(by_component['unequal'].max())} of {int(by_component['chunks'].max())}"
