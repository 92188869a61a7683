"""The table of the latency model, made again from the times that it is of.

Gate D draws from what is measured, and `model.parquet` says how far that is from processes that
were left out. Both of its columns follow from `latency.parquet` and the root seed, so neither is
believed: who writes down what was measured as what was drawn has a model that is always right.
"""

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from gates.evidence import Array, MissingEvidenceError
from gates.reproducibility.latency_budget import MEASURED_HERE, WARM
from genpolicy.seeds import stream

DRAWN = 1000
"""Invocations that are drawn of each model (`genpolicy.evidence.reproducibility.latency`)."""
CLOSE = 1e-9
"""Relative; terms are summed in another order here."""


def require_as_timed(
    model: pd.DataFrame, times: pd.DataFrame, method: str, *, root_seed: int
) -> None:
    """Hold rows of `model.parquet` against the rows of `latency.parquet` that they are made of.

    Args:
        model: Rows of a method.
        times: Times of the method.
        method: The method.
        root_seed: Root seed of the ladder.

    Raises:
        MissingEvidenceError: What was measured or drawn is another number, or of no process.
    """
    measured = times[(times["source"] == "measured") & (times["temperature"] == WARM)]
    wall = measured["seconds"].to_numpy(dtype=np.float64, na_value=np.nan)
    waited = measured["waited_s"].to_numpy(dtype=np.float64, na_value=np.nan)
    unknown = times.loc[times["source"] == "measured", "waited_s"].isna().any()
    uniform = uniforms(root_seed)
    kinds = (("", wall), ("_running", None if unknown else wall - waited))
    for kind, seconds in kinds:
        found = model[[f"measured{kind}_s", f"drawn{kind}_s"]]
        if seconds is None:
            if not found.isna().all(axis=None):
                raise MissingEvidenceError(f"{method}: times without a wait that nobody knows")
            continue
        again = pd.DataFrame(
            quantiles_of(measured.assign(seconds=seconds), model, uniform), index=model.index
        )
        stated = found.to_numpy(dtype=np.float64, na_value=np.nan)
        same = np.isclose(stated, again.to_numpy(), rtol=CLOSE, atol=0.0).all(axis=0)
        for said, holds in zip(("measured", "drawn"), same, strict=True):
            if not holds:
                raise MissingEvidenceError(
                    f"{method}: what model.parquet says was {said} is not what the times of "
                    f"latency.parquet give{' without the time waited' if kind else ''}"
                )


@functools.cache
def uniforms(root_seed: int) -> dict[str, Array]:
    """The uniform number behind each term of each drawn invocation; none is a session's first."""
    return {
        term: np.array(
            [
                stream(root_seed, "latency", "latency/model", 0, invocation, term).random()
                for invocation in range(1, DRAWN + 1)
            ]
        )
        for term in MEASURED_HERE
    }


def quantiles_of(
    rows: pd.DataFrame, model: pd.DataFrame, uniform: dict[str, Array]
) -> Iterator[tuple[float, float]]:
    """Measured and drawn quantile of each row of the model; NaN of a process that was not timed."""
    spans, taken = _spans_of(rows), {term: _taken(rows, term) for term in uniform}
    known: dict[tuple[int, int], tuple[Array, Array]] = {}
    for run, process, level in zip(model["run"], model["process"], model["level"], strict=True):
        if (key := (int(run), int(process))) not in known:
            known[key] = spans.of(*key), _drawn_without(taken, uniform, *key)
        yield tuple(  # type: ignore[misc]
            float(np.quantile(found, level, method="higher")) if len(found) else np.nan
            for found in known[key]
        )


@dataclass(frozen=True)
class _Timed:
    """Times, each of a process of a run. Shape (n,) each."""

    run: NDArray[np.generic]
    process: NDArray[np.generic]
    seconds: Array

    def own(self, run: int, process: int) -> NDArray[np.bool_]:
        """Which of them are of a process. Shape (n,)."""
        return np.asarray((self.run == run) & (self.process == process), dtype=np.bool_)

    def of(self, run: int, process: int) -> Array:
        """Those of a process."""
        return self.seconds[self.own(run, process)]


def _spans_of(rows: pd.DataFrame) -> _Timed:
    """What each invocation took, in order of its repeat."""
    sums = rows.groupby(["run", "process", "repeat"])["seconds"].sum()
    run, process = (sums.index.get_level_values(name).to_numpy() for name in ("run", "process"))
    return _Timed(run, process, sums.to_numpy())


def _taken(rows: pd.DataFrame, term: str) -> _Timed:
    """What a term took, in ascending order; one that nobody times behind the wire is 0."""
    own = rows[rows["component"] == term]
    seconds = own["seconds"].fillna(0.0).to_numpy(dtype=np.float64)
    order = np.argsort(seconds, kind="stable")
    run, process = own["run"].to_numpy()[order], own["process"].to_numpy()[order]
    return _Timed(run, process, seconds[order])


def _drawn_without(
    taken: dict[str, _Timed], uniform: dict[str, Array], run: int, process: int
) -> Array:
    """What invocations take that are drawn from all processes but one, s; none without a term."""
    drawn = np.zeros(DRAWN)
    for term, at in uniform.items():
        others = taken[term].seconds[~taken[term].own(run, process)]
        if len(others) == 0:
            return np.empty(0)
        drawn += others[np.minimum(len(others) - 1, (at * len(others)).astype(np.int64))]
    return drawn
