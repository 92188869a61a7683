"""What could not be asked of the data is said, with its reason; nothing else is."""

from dataclasses import replace

import numpy as np
import pytest
from planar import SETTINGS, planar

from genpolicy.audit.asked import Given, questions
from genpolicy.audit.data import canonical
from genpolicy.audit.predictability import HISTORY, Prediction
from genpolicy.audit.question_names import ALWAYS, CLOCK, COLUMN, FROZEN, PAST
from genpolicy.audit.semantics import measure

WHOLE = SETTINGS.model_copy(update={"declared_lag_rows": 1.0})
PAST_ROW = Prediction(HISTORY, "approach", 0.0, -0.1, 0.1, 0.5, 0.5, 90)


@pytest.fixture(scope="module")
def data():
    return canonical(planar(episodes=40)[0])


def silent(
    data, settings=WHOLE, *, told=(PAST_ROW,), phases=("approach",), replays=60, checked=True
):
    found = measure(data, settings)
    rows = questions(data, settings, found, told, phases, given=Given(replays, checked))
    assert all(row.asked == (row.reason == "") for row in rows)
    return {row.check for row in rows if not row.asked}


def episodes(data, **changes):
    return replace(data, episodes=replace(data.episodes, **changes))


def test_where_everything_is_given_everything_is_asked(data):
    assert silent(data) == set()


def text(data, value):
    return np.full(len(data.episodes), value)


@pytest.mark.parametrize(
    ("change", "expected"),
    [(lambda d: episodes(d, operator=text(d, "")), {"operator"}),
     (lambda d: episodes(d, object=text(d, "not_recorded")), {"object"}),
     (lambda d: episodes(d, calibration_epoch=text(d, "e1")),
      {"calibration_at_reference", "calibration_at_rest"}),
     (lambda d: episodes(d, order=np.full(len(d.episodes), np.nan)), {"order"}),
     (lambda d: replace(d, reference=None), {"calibration_at_reference"}),
     (lambda d: replace(d, streams={**d.streams, "scale": slice(4, 5)}),
      {"clock.scale", "frozen.scale"})],
)  # fmt: skip
def test_what_was_not_recorded_is_not_asked(data, change, expected):
    assert silent(change(data)) == expected


@pytest.mark.parametrize(
    ("changes", "expected"),
    [({"calibration_phase": ""}, {"calibration_at_reference"}),
     ({"calibration_phase": "no such phase"}, {"calibration_at_reference"}),
     ({"declared_lag_rows": None}, {"constant_lag"})],
)  # fmt: skip
def test_what_the_settings_do_not_name_is_not_asked(data, changes, expected):
    assert silent(data, WHOLE.model_copy(update=changes)) == expected


def test_a_scene_that_stands_still_is_not_asked_whether_it_froze(data):
    seen = replace(data, streams={"robot": slice(0, 2), "camera": slice(2, 4)})
    assert silent(seen) == {"clock.camera", "frozen.camera"}


def test_what_the_audit_was_not_given_is_not_asked(data):
    assert silent(data, replays=0) == {"labels"}
    assert silent(data, checked=False) == {"feasibility"}
    assert silent(data, told=()) == {"past.approach"}
    assert silent(data, told=(), phases=()) == set()
    alone = replace(data, paired=False, observation_position=slice(0, 0), reference=None)
    assert {"units_frames_and_lag", "constant_lag", "calibration_at_rest"} <= silent(alone)


def test_every_question_has_a_name_that_may_be_waived(data):
    """Nothing else may be asked, and what is asked of all data is there whatever they hold."""
    seen = replace(
        data,
        streams={"robot": slice(0, 2), "camera": slice(2, 4)},
        left_out=(("serial", "names the episode"),),
    )
    for given in (data, seen):
        found = measure(given, WHOLE)
        rows = questions(given, WHOLE, found, (PAST_ROW,), ("approach",), given=Given(60, True))
        names = [row.check for row in rows]
        kinds = {name[: name.find(".") + 1] for name in names} - {""}
        assert set(ALWAYS) == {name for name in names if "." not in name}
        assert len(names) == len(set(names))
        assert kinds <= {CLOCK, FROZEN, COLUMN, PAST}
    assert kinds == {CLOCK, FROZEN, COLUMN, PAST}
