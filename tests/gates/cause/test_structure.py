"""Absence takes support along the whole way, and noise takes a share of what was looked at."""

from dataclasses import replace

import pytest
from planted import VALID, counts, named

from gates.cause import CauseName

ABSENT = counts(two_mode_episodes=0, two_mode=0, persistent=0)


def reach(*shares):
    rows = zip(VALID.reach, shares, strict=True)
    return tuple(replace(row, queries=100, spoke=round(100 * share)) for row, share in rows)


def test_one_action_is_not_said_where_situations_crowd_at_the_end():
    crowded = replace(ABSENT, reach=reach(0.3, 0.4, 0.6, 0.9, 1.0))
    cause = named(crowded)
    assert (cause.name, cause.kind) == (CauseName.INSUFFICIENT_SUPPORT, "neighbourhoods")
    assert "first (30%), second (40%)" in cause.next_action
    along = replace(ABSENT, reach=reach(0.5, 0.5, 0.6, 0.9, 1.0))
    assert named(along).name is CauseName.UNIMODAL
    # Modes that were seen are not denied by what could not be looked at.
    assert named(replace(VALID, reach=crowded.reach)).name is CauseName.VALID_MODES


@pytest.mark.parametrize(("apart", "name"), [(60, "unimodal"), (900, "pointwise_noise")])
def test_a_handful_of_clusters_that_fall_apart_is_no_noise(apart, name):
    numbers = counts(
        two_mode_episodes=0, two_mode=0, persistent=0, queries=2400, analysed=2378, incoherent=apart
    )
    assert named(numbers).name.value == name


def test_white_noise_must_be_a_share_of_what_chunks_differ_by():
    trembling = {"noise_ratio": 0.9, "noise_spread": 0.01, "two_mode_episodes": 0}
    assert named(counts(**trembling, white_share=0.3)).name is CauseName.POINTWISE_NOISE
    assert named(counts(**trembling, white_share=0.05)).name is CauseName.UNIMODAL
