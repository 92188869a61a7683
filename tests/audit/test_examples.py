"""What a person looks at: clocks before and after realignment, support, examples, names."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from planar import SETTINGS, planar

from genpolicy.audit.components import Component
from genpolicy.audit.data import canonical
from genpolicy.audit.examples import (
    EXAMPLES,
    alignment,
    example_chunks,
    position_names,
    position_unit,
    support_points,
)
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood, Support
from genpolicy.audit.semantics.report import Semantics
from genpolicy.audit.situations import Situation


@pytest.fixture(scope="module")
def late():
    """Every second episode belongs to an epoch whose states come three rows late."""
    return canonical(planar(episodes=12, clock_steps=3)[0])


def situation(data, row, separation=0.1):
    members = np.flatnonzero(data.index == row)
    place = Neighbourhood(int(members[-1]), members[:-1], np.linspace(0, 1, len(members) - 1))
    side = (data.action[np.flatnonzero(data.index == 12), 1] > 0).astype(int)
    split = Clustering(side, separation, (0, 1))
    return Situation("approach", place, split, True, None, None, 0.1, 0.01)


def test_offsets_are_seen_before_and_gone_after_realignment(late):
    off = late.episodes.calibration_epoch == "epoch_2"
    semantics = Semantics((), (), 0, 0, 0.0, shift_rows=np.where(off, 3, 0))
    rows = alignment(SimpleNamespace(data=late, semantics=semantics), SETTINGS)
    assert [row.episode_uuid for row in rows] == late.episodes.uuid.tolist()
    before = np.array([row.offset_before_s for row in rows])
    after = np.array([row.offset_after_s for row in rows])
    assert np.median(before[off]) - np.median(before[~off]) == pytest.approx(0.3, abs=0.02)
    assert np.abs(after).max() < 0.03


def test_without_a_recorded_order_episodes_are_numbered(late):
    table = replace(late.episodes, order=np.full(12, np.nan))
    still = SimpleNamespace(data=replace(late, episodes=table),
                            semantics=Semantics((), (), 0, 0, 0.0))  # fmt: skip
    assert [row.order for row in alignment(still, SETTINGS)] == list(range(12))


def test_what_pairs_with_nothing_has_no_clock(late):
    unpaired = replace(late, paired=False)
    assert alignment(SimpleNamespace(data=unpaired, semantics=None), SETTINGS) == []
    assert position_unit(unpaired) == "" and position_names(unpaired)[0] == "action 0"


def test_every_query_is_a_point_analysed_or_not(late):
    item = situation(late, 2)
    result = SimpleNamespace(
        data=late, situations=(item,), support=(Support("approach", 3, 1, (5, 40)),)
    )
    points = support_points(result)
    assert [(p.analysed, p.two_mode) for p in points].count((True, True)) == 1
    assert len(points) == 3 and sum(p.analysed for p in points) == 1
    assert [len(p.position) for p in points] == [2, 2, 2]


def test_examples_are_spread_over_the_separations_and_hold_every_member(late):
    items = tuple(situation(late, 2, separation=0.01 * k) for k in range(9))
    found = SimpleNamespace(
        data=late, situations=items, component=Component("position", "varies", "", 0.03)
    )
    rows = example_chunks(found, SETTINGS)
    assert {row.example for row in rows} == set(range(EXAMPLES))
    first = [row for row in rows if row.example == 0]
    assert len(first) == 12 and sum(row.is_query for row in first) == 1
    query = next(row for row in first if row.is_query)
    assert query.distance == 0.0 and query.episode_uuid == query.query_uuid
    # The clusters lie on two sides of the axis along which they differ.
    left, right = ({row.coordinate > 0 for row in first if row.cluster == k} for k in (0, 1))
    assert left != right and len(left) == len(right) == 1
    assert example_chunks(SimpleNamespace(data=late, situations=()), SETTINGS) == []


def test_components_are_named_without_their_common_channel_and_units_must_agree(late):
    def named(*names):
        return replace(late, observation_names=(*names, *late.observation_names[2:]))

    assert position_names(named("tcp.x_m", "tcp.y_m")) == ["x_m", "y_m"]
    assert position_names(named("tcp.x_m", "hand.y_m")) == ["tcp.x_m", "hand.y_m"]
    assert position_unit(named("tcp.x_m", "tcp.y_m")) == "m"
    assert position_unit(named("arm_rad.a", "arm_rad.b")) == "rad"
    assert position_unit(named("tcp.x_m", "tcp.y_px")) == ""
    assert position_unit(named("tcp.x", "tcp.y")) == ""
