"""Reading numbers: counts that cannot be and numbers that are not there are refused by name."""

import math
from dataclasses import replace
from functools import reduce
from operator import getitem

import pytest
from planted import OFFSET, VALID

from gates.cause.reading import read_measured, read_numbers
from gates.evidence import MissingEvidenceError
from genpolicy.audit.documents import PERSISTENCE, SUMMARY, Persistence, Summary
from genpolicy.audit.reach_rows import (
    LEARNED,
    LOCAL,
    Alternative,
    FindingDraw,
    Reach,
    Side,
    StructureDraw,
)
from genpolicy.audit.rows import Calibration, Clock, ReplayRow, Resample
from genpolicy.errors import BadInputError, IntegrityError

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
SUMMED = Summary(
    **{name: 0 for name in Summary.__dataclass_fields__} | {
        "floors": {}, "ceilings": {}, "metre": 1.0, "position_unit": "m",
        "primary_phase": "approach", "counts": VALID.counts, "position_names": [], "notes": [],
        "obstacles": [],
    }
)  # fmt: skip
KEPT = Persistence(VALID.kept.observed, VALID.kept.null_q95, 0.5, VALID.kept.n)
DOCUMENTS = {SUMMARY: SUMMED, PERSISTENCE: KEPT}


DRAW = Resample(
    disagreements=0, disagreement_upper=0.1, two_mode=120, two_mode_episodes=45, incoherent=0,
    persistent=110, kept=0.95, kept_null_q95=0.6, kept_n=118, p_adjusted=(0.9,), effect=(0.05,),
    effect_lower=(0.0,), told=(0.05,), success_lower=(0.9, 0.9), admissible=(50, 48),
)  # fmt: skip
STRUCTURE = StructureDraw(
    queries=200, analysed=180, analysed_episodes=50, primary_episodes=50, resolved=0,
    noise_ratio=0.1, noise_spread=0.01, white_share=0.02, reach_queries=(40,) * 5,
    reach_spoke=(36,) * 5, findings=-1, successes=(40, 39),
)  # fmt: skip


def draws(**changed):
    tables = TABLES | {"structure_draws.parquet": [STRUCTURE], "resamples.parquet": [DRAW]}
    tables |= {f"{name}.parquet": rows for name, rows in changed.items()}
    return read_numbers(DOCUMENTS.__getitem__, lambda name, _: list(tables.get(name, ())))[1]


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
     ({"alternatives": (Alternative("approach", "m0", "m0", 120),)}, "m0 beside itself"),
     ({"predictions": [replace(VALID.told[0], told_upper=None)]}, r"told_upper is not known"),
     ({"sides": []}, "StopIteration")],
)  # fmt: skip
def test_what_cannot_be_is_refused_by_name(changed, match):
    with pytest.raises(BadInputError, match=match):
        read(**changed)


TEST = ("p_value", "p_adjusted", "effect", "effect_lower", "effect_upper")
UNTESTED = replace(VALID.strata[0], recorded=False, n=0, **dict.fromkeys(TEST))


@pytest.mark.parametrize("column", TEST)
@pytest.mark.parametrize("value", [None, math.nan])
def test_a_test_that_was_run_is_known_in_all_its_numbers(column, value):
    damaged = replace(VALID.strata[0], **{column: value})
    with pytest.raises(BadInputError, match="the test of operator in approach is not known"):
        read(strata=[UNTESTED, damaged])


def test_what_was_not_recorded_was_not_tested():
    assert read(strata=[UNTESTED]).strata == (UNTESTED,)
    for contradicting in (
        replace(UNTESTED, recorded=True),
        replace(UNTESTED, effect=0.9),
        replace(VALID.strata[0], recorded=False),
    ):
        with pytest.raises(BadInputError, match="the test of operator in approach is not known"):
            read(strata=[contradicting])


@pytest.mark.parametrize("place", ["p_adjusted", "effect", "effect_lower"])
def test_a_test_of_a_resample_is_known_as_well(place):
    drawn = replace(DRAW, **{place: (None,)})
    with pytest.raises(BadInputError, match="the test of operator in approach is not known"):
        draws(resamples=[drawn])
    assert len(draws(resamples=[DRAW])) == 1


@pytest.mark.parametrize(
    ("kind", "place"),
    [(SUMMARY, "counts.noise_ratio"), (SUMMARY, "counts.incoherent"), (PERSISTENCE, "null_q95"),
     (PERSISTENCE, "n")],
)  # fmt: skip
def test_a_count_that_is_not_there_is_no_number(kind, place):
    plain = kind.plain(DOCUMENTS[kind])
    *above, name = place.split(".")
    reduce(getitem, above, plain)[name] = None
    with pytest.raises(IntegrityError, match=f"{place} = None"):
        kind.parse(plain, where="the audit")


@pytest.mark.parametrize(
    ("row", "changes"),
    [
        (DRAW, {"p_adjusted": ()}), (DRAW, {"effect": ()}), (DRAW, {"effect_lower": ()}),
        (DRAW, {"told": ()}), (DRAW, {"told": (0.1, 0.2)}), (DRAW, {"admissible": (50,)}),
        (DRAW, {"admissible": (50, 48, 40)}), (DRAW, {"p_adjusted": (0.9, 0.9)}),
        (STRUCTURE, {"successes": (40,)}), (STRUCTURE, {"reach_queries": (40,) * 4}),
        (STRUCTURE, {"reach_spoke": (36,) * 6}),
    ],
)  # fmt: skip
def test_a_resample_speaks_of_all_that_was_measured_and_of_no_more(row, changes):
    damaged = replace(row, **changes)
    name = "resamples" if row is DRAW else "structure_draws"
    with pytest.raises(BadInputError, match="ValueError"):
        draws(**{name: [damaged]})


def test_every_resample_has_both_of_its_rows():
    for tables in ({"resamples": [DRAW, DRAW]}, {"structure_draws": [STRUCTURE] * 2}):
        with pytest.raises(BadInputError, match="ValueError"):
            draws(**tables)


def test_what_cannot_be_of_a_resample_is_refused():
    with pytest.raises(BadInputError, match="41 of 40 replayed labels"):
        draws(resamples=[replace(DRAW, disagreements=41)])
    with pytest.raises(BadInputError, match="-1 of 40 replayed labels"):
        draws(resamples=[replace(DRAW, disagreements=-1)])
    assert draws(resamples=[replace(DRAW, disagreements=40)])[0].labels.disagreements == 40


def test_a_resample_has_the_findings_of_its_own_half_or_those_of_all():
    """Draw -1 found what all did; any other has its own, and none where none is written."""
    other = replace(OFFSET, measured=0.2)
    rows = {"findings": [OFFSET], "finding_draws": [FindingDraw(0, **vars(other))]}
    for half, found in ((-1, (OFFSET,)), (0, (other,)), (1, ())):
        (drawn,) = draws(structure_draws=[replace(STRUCTURE, findings=half)], **rows)
        assert drawn.findings == found


def test_what_a_resample_tells_moves_its_interval_along():
    (drawn,) = draws(resamples=[replace(DRAW, told=(0.25,))])
    row, was = drawn.told[0], VALID.told[0]
    assert row.told == 0.25
    assert row.told_lower - was.told_lower == pytest.approx(0.25 - was.told)
    assert row.told_upper - was.told_upper == pytest.approx(0.25 - was.told)


def test_each_kind_of_evidence_and_each_phase_is_read_into_its_place():
    other = replace(SIDE, kind=LEARNED, followed=False, analysed=7)
    far = Reach(LEARNED, 1, 10, 3)
    mode = replace(VALID.modes[0], phase="retreat")
    numbers = read(
        sides=[other, SIDE], reach=[far, *VALID.reach], modes=[*VALID.modes, mode],
        replay=[ReplayRow("e0", "success", "failure", None), *TABLES["replay.parquet"]],
    )  # fmt: skip
    assert (numbers.kind, numbers.other) == (LOCAL, other)
    assert (numbers.reach, numbers.other_reach) == (VALID.reach, (far,))
    assert (numbers.modes, numbers.elsewhere) == (VALID.modes, (mode,))
    assert (numbers.labels.replays, numbers.labels.disagreements) == (41, 1)
