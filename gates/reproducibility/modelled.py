"""The table of the latency model, made again from the times that it is of.

Gate D draws from what is measured, and `model.parquet` says how far that is from processes that
were left out. Both of its columns follow from `latency.parquet` and the root seed, so neither is
believed: who writes down what was measured as what was drawn has a model that is always right.
"""

import functools
from collections.abc import Iterator

import numpy as np
import pandas as pd

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
    known: dict[tuple[int, int], tuple[Array, Array]] = {}
    for run, process, level in zip(model["run"], model["process"], model["level"], strict=True):
        if (run, process) not in known:
            known[run, process] = _spans(rows, int(run), int(process), uniform)
        yield tuple(  # type: ignore[misc]
            float(np.quantile(spans, level, method="higher")) if len(spans) else np.nan
            for spans in known[run, process]
        )


def _spans(
    rows: pd.DataFrame, run: int, process: int, uniform: dict[str, Array]
) -> tuple[Array, Array]:
    """What invocations of a process took, and those drawn from all other processes, s."""
    own = (rows["run"] == run) & (rows["process"] == process)
    measured = rows[own].groupby("repeat")["seconds"].sum().to_numpy()
    # A term that somebody behind the wire does not time is part of another one.
    others = rows[~own].fillna({"seconds": 0.0})
    drawn = np.zeros(DRAWN)
    for term, at in uniform.items():
        taken = np.sort(others.loc[others["component"] == term, "seconds"].to_numpy())
        if len(taken) == 0:
            return measured, np.empty(0)
        drawn += taken[np.minimum(len(taken) - 1, (at * len(taken)).astype(np.int64))]
    return measured, drawn
