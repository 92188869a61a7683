"""Fixtures drawn again: from the files, in fresh processes, on the CPU and where it is deployed.

Training draws them on the CPU, so there the same weights must give the same bits. Another device
adds in another order, so what it promises is asked of itself: two processes that load there must
agree to the bit.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from genpolicy.candidates.judged import JudgedPolicy
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import load_dataset
from genpolicy.errors import NonFiniteError
from genpolicy.evidence.reproducibility.measure import in_fresh_process
from genpolicy.evidence.rows.reproducibility import FIXTURES_ON, SampleRow
from genpolicy.policies.fixtures import (
    Compared,
    FixtureRow,
    compare_fixtures,
    fixture_observations,
    fixture_rows,
    reload_fixture,
)


def fixtures_again(
    candidate: JudgedPolicy,
    before: Sequence[FixtureRow],
    dataset: Path,
    *,
    horizons: HorizonConfig,
) -> tuple[list[SampleRow], int, int]:
    """Fixtures of one checkpoint against those of its training, and on its device against itself.

    Args:
        candidate: The checkpoint.
        before: Its fixtures, as training drew them.
        dataset: Folder of the dataset.
        horizons: Common horizons.

    Returns:
        Rows of `samples.parquet`, network evaluations counted, and metadata fields that differ.

    Raises:
        ConfigError: This machine has no such device.
    """
    after = in_fresh_process(
        reload_fixture, candidate.folder, dataset, horizons=horizons, method=candidate.name,
        seed=candidate.seed, count=len(before),
    )  # fmt: skip
    compared, differing = compare_fixtures(before, after)
    rows = _rows(candidate, FIXTURES_ON, compared)
    if candidate.device != FIXTURES_ON:
        first, again = (
            in_fresh_process(
                draw_fixtures, candidate, dataset, horizons=horizons, count=len(before)
            )
            for _ in range(2)
        )
        there, further = _on_its_device(first, again, len(before))
        rows += _rows(candidate, candidate.device, there)
        differing += further
    return rows, after[0].nfe, differing


def draw_fixtures(
    candidate: JudgedPolicy, dataset: Path, *, horizons: HorizonConfig, count: int
) -> list[FixtureRow]:
    """The fixtures of a checkpoint on its device; none where one of them is no numbers."""
    observations = fixture_observations(load_dataset(dataset), horizons=horizons, count=count)
    try:
        return fixture_rows(
            candidate.load(), observations, method=candidate.name, seed=candidate.seed
        )
    except NonFiniteError:
        return []


def _on_its_device(
    first: Sequence[FixtureRow], again: Sequence[FixtureRow], count: int
) -> tuple[list[Compared], int]:
    """Two draws of one device; a difference of NaN where one of them is no numbers."""
    if first and again:
        return compare_fixtures(first, again)
    return [Compared(row, "", "", math.nan) for row in range(count)], 0


def _rows(candidate: JudgedPolicy, device: str, compared: Sequence[Compared]) -> list[SampleRow]:
    return [
        SampleRow(candidate.name, candidate.seed, device=device, **asdict(one)) for one in compared
    ]
