"""Whether a checkpoint comes back as it was trained, asked again here.

Every fixture is drawn again from the files, and asked for in the other ways: alone, beside others,
in another order, with other threads. What training drew, and what is said to differ, are held
against that. Another processor rounds otherwise, so numbers may lie a little apart; what they are
of may not. Of who was brought `gates.rederive_conformance` asks.
"""

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gates.rederive_measured import Bench, trained_in
from gates.reproducibility.fixtures import DRAWN
from gates.reproducibility.settings import RELOAD, SAMPLES
from gates.stated import mapping, refuse
from genpolicy.candidates.answering import AnsweringPolicy
from genpolicy.contract.chunk import actions_sha256
from genpolicy.errors import NonFiniteError
from genpolicy.evidence.reproducibility.variations import of_threads
from genpolicy.evidence.rows.reproducibility import FIXTURES_ON, SampleRow, VariationRow
from genpolicy.integrity.rows import read_rows
from genpolicy.policies.fixtures import (
    CANDIDATES,
    METADATA,
    Compared,
    FixtureRow,
    compare_fixtures,
    fixture_observations,
    fixture_rows,
)
from genpolicy.policies.policy import NetworkPolicy

VARIATIONS = f"{RELOAD}/variations.parquet"
ROUNDED = 1e-5
"""What another processor makes of the same sum at most: the bound of `samples_difference`."""
Who = tuple[str, int]
Array = NDArray[np.float64]
Row = TypeVar("Row", FixtureRow, SampleRow, VariationRow)


def rederive_fixtures(bench: Bench) -> None:
    """Draw the fixtures of every trained candidate again, on the CPU, in all ways.

    Raises:
        RefusedError: What training drew is not what its checkpoint draws, is of another one, or
            differs by more than is said; a fixture or a way lacks, or stands twice.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A file is missing, or is not what it claims to be.
        BadInputError: A table cannot be read.
    """
    root, params = bench.root, bench.params
    count = bench.number("policy", "fixtures")
    observations = fixture_observations(bench.data, horizons=bench.horizons, count=count)
    drawn = read_rows(root / DRAWN, FixtureRow)
    samples = [row for row in read_rows(root / SAMPLES, SampleRow) if row.device == FIXTURES_ON]
    varied = read_rows(root / VARIATIONS, VariationRow)
    for method in mapping(mapping(params.get("train_generators")).get("samplers")):
        for seed, own in trained_in(bench, "train_generators", method):
            who = (method, seed)
            compared = _as_trained(_of_one(drawn, who), _again(own, observations, who), who)
            _samples(_of_one(samples, who), compared, who)
            if own.device == FIXTURES_ON:
                _ways(_of_one(varied, who), own, observations, who)


def _of_one(rows: Sequence[Row], who: Who) -> list[Row]:
    return [row for row in rows if (row.method, row.seed) == who]


def _again(own: NetworkPolicy, observations: Array, who: Who) -> list[FixtureRow]:
    plain = NetworkPolicy(own.checkpoint, sampler=own.sampler, device=FIXTURES_ON)
    on_cpu = AnsweringPolicy(plain)
    try:
        return fixture_rows(on_cpu, observations, method=who[0], seed=who[1])
    except NonFiniteError as error:
        refuse("B", f"{_of(who)}: fixtures", str(error), "numbers, as training drew them")


def _as_trained(
    first: Sequence[FixtureRow], again: Sequence[FixtureRow], who: Who
) -> list[Compared]:
    """What training says that it drew, against what its checkpoint draws."""
    rows = [row.row for row in first]
    if rows != [row.row for row in again]:
        refuse("B", f"{_of(who)}: {DRAWN}", f"{len(rows)} rows", f"fixtures 0 to {len(again) - 1}")
    for row, own in zip(first, again, strict=True):
        for name in METADATA:
            stated, found = getattr(row, name), getattr(own, name)
            if stated != found:
                refuse("B", f"{_of(who)}, fixture {row.row}: {name}", f"{stated!r:.40}",
                       f"{found!r:.40}, as its checkpoint says")  # fmt: skip
        chunks = np.asarray(row.samples)
        shape = (CANDIDATES, row.prediction_horizon, -1)
        if len(row.samples) != len(own.samples) or row.sha256 != actions_sha256(
            chunks.reshape(shape)
        ):
            refuse("B", f"{_of(who)}, fixture {row.row}: sha256", row.sha256[:12],
                   "that of the numbers beside it")  # fmt: skip
    return compare_fixtures(first, again)[0]


def _samples(stated: Sequence[SampleRow], compared: Sequence[Compared], who: Who) -> None:
    """What is said to have come back: of the same samples, and no nearer to them than it is."""
    rows = [row.row for row in stated]
    if rows != [one.row for one in compared]:
        expected = f"fixtures 0 to {len(compared) - 1} on {FIXTURES_ON}"
        refuse("B", f"{_of(who)}: {SAMPLES}", f"{len(rows)} rows", expected)
    for row, one in zip(stated, compared, strict=True):
        place = f"{_of(who)}, fixture {row.row}"
        if row.sha256_trained != one.sha256_trained:
            refuse("B", f"{place}: sha256_trained", row.sha256_trained[:12],
                   f"{one.sha256_trained[:12]}, of what training drew")  # fmt: skip
        told = row.max_abs_difference
        if row.sha256_trained == row.sha256_reloaded and told != 0.0:
            refuse("B", f"{place}: max_abs_difference", f"{told:.3g}", "0, as of the same bits")
        if not one.max_abs_difference <= told + ROUNDED:
            refuse("B", f"{place}: max_abs_difference", f"{told:.3g}",
                   f"{one.max_abs_difference:.3g}, as its checkpoint draws again")  # fmt: skip


def _ways(
    stated: Sequence[VariationRow], own: NetworkPolicy, observations: Array, who: Who
) -> None:
    """What is said to change a sample beside its own name: no less than does here."""
    told = {(row.variation, row.component): row for row in stated}
    found = of_threads(own, observations).rows(who[0], seed=who[1], device=FIXTURES_ON)
    ways = [(row.variation, row.component) for row in found]
    if sorted(told) != sorted(ways) or len(stated) != len(ways):
        refuse("B", f"{VARIATIONS}: {_of(who)}", f"{len(stated)} rows",
               f"one row for each of {len(ways)} ways and components")  # fmt: skip
    for row in found:
        said = told[row.variation, row.component]
        place = f"{_of(who)}, {row.variation}: {row.component}"
        if said.unknown or said.chunks != row.chunks:
            refuse("B", place, said.unknown or f"{said.chunks} chunks", f"{row.chunks} chunks")
        largest = said.max_abs_difference
        if largest is None or not _no_more(row.max_abs_difference or 0.0, largest):
            refuse("B", place, f"differs by {largest}", f"{row.max_abs_difference}, as found again")


def _no_more(found: float, told: float) -> bool:
    """Whether what differs here was told; who gave up one of two differs by NaN from the other."""
    return found <= told + ROUNDED or (math.isnan(found) and math.isnan(told))


def _of(who: Who) -> str:
    return f"{who[0]} (seed {who[1]})"
