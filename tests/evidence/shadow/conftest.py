"""A shadow test of the default task, and held-out moments for it."""

import pytest

from genpolicy.evidence.shadow.observations import held_out_observations
from genpolicy.evidence.shadow.shadow import Shadow, admit, case_of
from genpolicy.execution.cell import Cell
from genpolicy.feasibility.admission import Admitted
from genpolicy.seeds import stream


@pytest.fixture(scope="session")
def shadow(task, checker, kit):
    return Shadow(
        task=task, checker=checker, cell=Cell(kit.HORIZONS, kit.EXECUTION), late_rows=1,
        samples=3,
    )  # fmt: skip


@pytest.fixture(scope="session")
def observations(data, kit):
    return held_out_observations(
        data, horizons=kit.HORIZONS, count=20, generator=stream(1, "shadow")
    )


@pytest.fixture(scope="session")
def demonstrated(shadow, observations):
    """A moment, what the operator did there as a case, and its admitted chunk."""
    for number, item in enumerate(observations):
        case = case_of(shadow, item, item.demonstrated, number=number)
        result = admit(shadow, case)
        if isinstance(result, Admitted):
            return item, case, result
    raise AssertionError("no demonstration was admitted")
