"""The freshness layer asks the rows of the table that concern it, in s, and NaN passes nothing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from genpolicy.execution.checks import CHECKS, Place, at, without
from genpolicy.feasibility.checks import CHECKS as TABLE
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.freshness import REASONS, fresh


@pytest.fixture(scope="module")
def moment(kit):
    return Context(
        q_meas=np.zeros(7), q_cmd=np.zeros(7), last_action=np.zeros(10), now_s=10.0,
        phase="approach", calibration_epoch="e0", session_epoch=1,
        latest_observation_event_time_s=9.95, maximum_age_s=0.3, active_checkpoint_hash="w",
        active_sampler_hash="s", scene=None,
    )  # fmt: skip


def alone(metadata, context, **options):
    """The margins of one chunk."""
    return fresh([metadata], [context], **options)[0]


FAULTS = {
    "session_epoch": {"session_epoch": 2},
    "calibration_mismatch": {"calibration_epoch": "e1"},
    "phase_transition": {"phase": "insert"},
    "checkpoint_mismatch": {"active_checkpoint_hash": "v"},
    "sampler_mismatch": {"active_sampler_hash": "t"},
    "future_observation": {"latest_observation_event_time_s": 9.89},
    "behind_accepted": {"newest_accepted_observation_s": 9.91},
    "stale_observation": {"maximum_age_s": 0.09},
    "expired": {"now_s": 10.41, "maximum_age_s": 1.0},
}


def test_the_layer_asks_exactly_its_rows(kit, moment):
    margins = alone(kit.metadata(), moment)
    assert set(margins) == {c.name for c in TABLE if c.layer == "fresh"} == set(FAULTS)
    assert all(margin >= 0 for margin in margins.values())
    assert margins["stale_observation"] == pytest.approx(0.2, abs=1e-9)
    assert margins["future_observation"] == pytest.approx(0.05, abs=1e-9)
    assert margins["behind_accepted"] == math.inf and margins["session_epoch"] == 0.0


@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_is_named_alone_and_a_table_without_its_row_does_not_know_it(kit, moment, name):
    faulty = replace(moment, **FAULTS[name])
    margins = alone(kit.metadata(), faulty)
    assert [key for key, margin in margins.items() if not margin >= 0] == [name]
    rest = alone(kit.metadata(), faulty, checks=without(CHECKS, name))
    assert set(rest) == set(margins) - {name} and all(margin >= 0 for margin in rest.values())


def test_a_row_has_one_name_and_one_reason_wherever_it_is_asked():
    rows = {check.name: check.reason for check in at(CHECKS, Place.LAYER)}
    assert rows == REASONS and set(rows) == {c.name for c in TABLE if c.layer == "fresh"}
    named = {check.name for check in TABLE} & {check.name for check in CHECKS}
    assert named - {"controller_mode"} == set(rows), "one name, one question"


@pytest.mark.parametrize("field", ["now_s", "maximum_age_s", "latest_observation_event_time_s"])
def test_a_time_that_is_no_number_passes_nothing(kit, moment, field):
    margins = alone(kit.metadata(), replace(moment, **{field: math.nan}))
    assert margins and not any(margin >= 0 for margin in margins.values())


def test_many_are_asked_as_one_by_one_also_of_contexts_that_some_share(kit, moment):
    late, lost = replace(moment, now_s=moment.now_s + 1.0), replace(moment, now_s=math.nan)
    chunks = [kit.metadata(), kit.metadata(task_phase="insert"), kit.metadata(session_epoch=9)]
    asked = [(chunk, context) for chunk in chunks for context in (moment, late, moment, lost)]
    found = fresh(*map(list, zip(*asked, strict=True)))
    for margins, (chunk, context) in zip(found, asked, strict=True):
        assert margins == pytest.approx(alone(chunk, context), abs=0.0, nan_ok=True)
    assert len({str(margins) for margins in found}) == 7  # three chunks, now and late; no time
