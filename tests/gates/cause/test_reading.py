"""Reading numbers: counts that cannot be and numbers that are not there are refused by name."""

import math
from dataclasses import replace

import pytest
from planted import VALID

from gates.cause.reading import read_measured, read_numbers
from gates.evidence import MissingEvidenceError
from genpolicy.audit.reach_rows import LOCAL, Side
from genpolicy.audit.rows import Calibration, Clock, ReplayRow
from genpolicy.errors import BadInputError

SIDE = Side(
    **{name: 0 for name in Side.__dataclass_fields__} | {"kind": LOCAL, "followed": True}
)  # fmt: skip
CLOCK = Clock("robot", "e1", 20, 0.0, -0.002, 2.0, 0.0, 0.0, 0.0)
TABLES = {
    "sides.parquet": [SIDE],
    "replay.parquet": [ReplayRow(f"e{n}", "success", "success", None) for n in range(40)],
    "strata.parquet": VALID.strata,
    "predictions.parquet": VALID.told,
    "modes.parquet": VALID.modes,
    "components.parquet": VALID.components,
    "alternatives.parquet": VALID.alternatives,
    "reach.parquet": VALID.reach,
    "clocks.parquet": [CLOCK, replace(CLOCK, offset_after_s=0.001)],
    "calibration.parquet": [Calibration("e1", 20, None)],
}
DOCUMENTS = {
    "summary.json": {
        "floors": {}, "ceilings": {}, "metre": 1.0, "position_unit": "m",
        "primary_phase": "approach",
        "counts": vars(VALID.counts),
    },
    "persistence.json": vars(VALID.kept),
}  # fmt: skip


def read(**changed):
    tables = TABLES | {f"{name}.parquet": rows for name, rows in changed.items()}
    return read_measured(DOCUMENTS.__getitem__, lambda name, _: list(tables.get(name, ())))


def test_numbers_are_read_as_they_were_measured():
    numbers = read()
    assert (numbers.modes, numbers.strata, numbers.kept) == (VALID.modes, VALID.strata, VALID.kept)
    assert (numbers.labels.replays, numbers.labels.disagreements) == (40, 0)
    assert numbers.residuals["clock_residual_s"].value == 0.002
    assert numbers.residuals["calibration_residual_m"].value is None
    assert numbers == read_numbers(
        DOCUMENTS.__getitem__, lambda name, _: list(TABLES.get(name, ()))
    )[0]  # fmt: skip


def test_a_residual_of_which_one_epoch_is_not_known_is_not_known():
    for value in (None, math.nan):
        found = read(clocks=[CLOCK, replace(CLOCK, offset_after_s=value)]).residuals
        assert found["clock_residual_s"].value is None
        assert found["clock_residual_s"].why == "not measured in every epoch"


def test_a_table_of_residuals_that_is_not_there_leaves_only_its_question_open():
    def rows(name, _):
        if name == "clocks.parquet":
            raise MissingEvidenceError(name)
        return list(TABLES.get(name, ()))

    found = read_measured(DOCUMENTS.__getitem__, rows).residuals["clock_residual_s"]
    assert (found.value, found.why) == (None, "clocks.parquet")


@pytest.mark.parametrize(
    ("changed", "match"),
    [({"modes": [replace(VALID.modes[0], successes=41), VALID.modes[1]]}, "41 of 40 episodes"),
     ({"modes": [replace(VALID.modes[0], admissible=51), VALID.modes[1]]}, "51 of 50 chunks"),
     ({"modes": VALID.modes[:1]}, "alternatives names the modes"),
     ({"predictions": [replace(VALID.told[0], told_upper=None)]}, r"told_upper is not known"),
     ({"sides": []}, "StopIteration")],
)  # fmt: skip
def test_what_cannot_be_is_refused_by_name(changed, match):
    with pytest.raises(BadInputError, match=match):
        read(**changed)
