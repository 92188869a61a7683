"""Fixtures asked for in another way: does a sample depend on anything but its name?"""

import numpy as np
import pandas as pd

from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError, counts, numbers
from gates.reproducibility.settings import RELOAD, ReproducibilitySettings
from genpolicy.contract.action import ACTION_COMPONENTS
from genpolicy.evidence.rows.reproducibility import ORDER, VARIATIONS, VariationRow

VARIED = f"{RELOAD}/variations.parquet"


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
    _require_whole(rows, brought=candidate in settings.brought)
    apart = np.abs(numbers(known, "max_abs_difference"))
    unequal = counts(known, "unequal")
    if np.any((unequal > 0) != (apart > 0)):
        raise MissingEvidenceError("chunks differ by nothing, or do not and differ by something")
    largest = known.iloc[int(apart.argmax())]
    seeds = rows["seed"].nunique()
    parts = [f"{way} {_unequal(part)}" for way, part in known.groupby("variation", sort=False)]
    text = f"chunks not bit-equal, of {seeds} training seeds: {', '.join(parts)}"
    if apart.max() > 0.0:
        text += f"; most by {largest['variation']}, in {largest['component']}"
    for way, part in rows[rows["unknown"] != ""].groupby("variation", sort=False):
        text += f"; unknown by {way}: {part['unknown'].iloc[0]}"
    return Measured(float(apart.max()), caveat=text)


def _require_whole(rows: pd.DataFrame, *, brought: bool) -> None:
    """Every component of every way, once, of every training seed; of what, and how many.

    Raises:
        MissingEvidenceError: It is not whole, or something was not asked that can be.
    """
    whole = {(way, component) for way in VARIATIONS for component in ACTION_COMPONENTS}
    for seed, part in rows.groupby("seed"):
        found = list(zip(part["variation"], part["component"], strict=True))
        if len(found) != len(whole) or set(found) != whole:
            raise MissingEvidenceError(f"{VARIED} does not hold each way once, of seed {seed}")
    known = rows["unknown"] == ""
    if not brought and not known.all():
        raise MissingEvidenceError("what is trained here can be asked in every way, and was not")
    if not known[rows["variation"] == ORDER].all():
        raise MissingEvidenceError("in another order anybody can be asked, and was not")
    if np.any((counts(rows, "chunks") > 0) != known.to_numpy()):
        raise MissingEvidenceError("no chunk was compared, or some were of what is unknown")


def _unequal(part: pd.DataFrame) -> str:
    """Of one way: the most chunks that differ in one component, of all training seeds."""
    by_component = part.groupby("component")[["unequal", "chunks"]].sum()
    return f"{int(by_component['unequal'].max())} of {int(by_component['chunks'].max())}"
