"""A rough policy at a fork: what one moment of each episode does not show, several do."""

import numpy as np
import pytest

from genpolicy.candidates.conformance.asked import Asked
from genpolicy.candidates.conformance.recorded_starts import RecordedStarts
from genpolicy.candidates.conformance.units import along, plausible
from genpolicy.candidates.wire.remote import Invocation
from genpolicy.contract.action import join_action

EPISODES, MOMENTS = 30, 5
SIDE_M, ROUGH_M = 0.1, 0.2
MIRRORED = np.array([1.0, -1.0, *[1.0] * 8])


def forked(rng, moments=MOMENTS):
    """Episodes that pass a post on either side, from the middle to the middle, and end there."""
    episodes = np.tile([f"episode {number}" for number in range(EPISODES)], moments)
    share = (rng.random(EPISODES) + np.arange(moments)[:, None] / moments).reshape(-1) % 1.0
    side = np.tile(rng.choice([-1.0, 1.0], EPISODES), moments)
    ends = np.tile(rng.normal(scale=[0.2, 0.015, 0.2], size=(EPISODES, 3)), (moments, 1))

    def place(share):
        beside = SIDE_M * side * np.clip(np.sin(2.0 * np.pi * share), 0.0, None)
        return ends * share[:, None] + np.stack([0 * beside, beside, 0 * beside], axis=1)

    path = np.stack([place(np.minimum(share + step / 40, 1.0)) for step in range(8)], axis=1)
    chunks = join_action(path, np.broadcast_to(np.eye(3), (len(share), 8, 3, 3)), 0.0)
    return RecordedStarts(np.zeros((len(share), 2, 1)), chunks, episodes, chunks[:, 0])


def answers(chunks):
    """Of drawn chunks (M, N, K, 10)."""
    asked = Asked()
    asked.answers = {
        row: Invocation(drawn, 4, {}, 0.0, 1) for row, drawn in enumerate(chunks)
    }  # fmt: skip
    return asked


def rough(starts, rng):
    """Hardly knows where it stands, and goes to either side of there."""
    drawn = np.repeat(starts.chunks[:, None], 4, axis=1)
    drawn[..., :3] += ROUGH_M * rng.normal(size=(*drawn.shape[:2], 1, 3))
    drawn[..., 1] += rng.choice([-1, 1], drawn.shape[:2])[..., None] * np.linspace(0, 0.2, 8)
    return drawn


def scale_of(chunks, starts):
    return next(one for one in plausible(answers(chunks), starts) if one.name == "scale")


def first(starts, number=EPISODES):
    return RecordedStarts(
        starts.observations[:number], starts.chunks[:number], starts.episodes[:number],
        starts.measured[:number],
    )  # fmt: skip


def test_a_rough_mirror_is_told_by_several_moments_of_each_episode():
    """Of eight, of which one moment of each tells one or two; an honest one is never accused."""
    told, told_by_one = 0, 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        starts = forked(rng)
        drawn = rough(starts, rng)
        mirrored = drawn * MIRRORED
        assert scale_of(drawn, starts).judged != "fails"
        found = scale_of(mirrored, starts)
        told += "y at the start of all moments" in found.said.partition("wrong: ")[2]
        told_by_one += scale_of(mirrored[:EPISODES], first(starts)).judged == "fails"
    assert told >= 7
    assert told_by_one <= 3


def test_of_what_knows_nothing_no_more_are_accused_than_the_level_says():
    """Of 200 that begin anywhere, alike within an episode, on three axes at half a per cent."""
    accused = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        starts = forked(rng)
        drawn = np.repeat(starts.chunks[:, None], 2, axis=1)
        drawn[..., :3] = np.tile(rng.normal(size=(EPISODES, 2, 1, 3)), (MOMENTS, 1, 1, 1))
        found = along(answers(drawn), starts, range(len(starts)))
        accused += sum(one.high < 0.0 for one in found)
    assert accused <= 9  # 3 are expected of 600


def test_a_weak_policy_that_shrinks_places_is_no_mirror():
    rng = np.random.default_rng(3)
    starts = forked(rng)
    drawn = np.repeat(starts.chunks[:, None], 2, axis=1)
    drawn[..., 1] *= 0.2
    found = along(answers(drawn), starts, range(len(starts)))
    (aside,) = [one for one in found if one.name.startswith("y ")]
    assert aside.low > 3.0
    by_all = scale_of(drawn, starts)
    assert "y at the start of all moments" not in by_all.said.partition("wrong: ")[2]


@pytest.mark.parametrize("whole", [20, 19])
def test_an_episode_counts_if_all_its_moments_were_answered(whole):
    rng = np.random.default_rng(0)
    starts = forked(rng)
    left_out = [EPISODES * 2 + number for number in range(EPISODES - whole)]
    finite = [row for row in range(len(starts)) if row not in left_out]
    found = along(answers(rough(starts, rng)), starts, finite)
    assert bool(found) == (whole == 20)


def test_one_moment_of_each_episode_is_asked_once():
    rng = np.random.default_rng(0)
    starts = first(forked(rng))
    assert along(answers(rough(starts, rng)), starts, range(len(starts))) == []


def test_all_other_findings_are_of_one_moment_of_each_episode():
    """Five moments of an episode are no five trials: further ones change nothing else."""
    rng = np.random.default_rng(1)
    starts = forked(rng)
    drawn = rough(starts, rng)
    wrong = drawn.copy()
    wrong[EPISODES:] = starts.chunks[EPISODES:, None] + 1e3
    few = plausible(answers(drawn[:EPISODES]), first(starts))
    many = plausible(answers(wrong), starts)
    for one, other in zip(few, many, strict=True):
        if one.name != "scale":
            assert one == other
