"""What the recordings that say one thing in several ways claim is so, seen without an audit."""

import numpy as np
import pytest

from benchmarks.audit_real.catalogue import AS_IS, CHANGES, Case, made

SEED = 11


def small(base, name=AS_IS, episodes=24):
    """A small recording with a change."""
    return made(Case(base, ((name, CHANGES[name].strengths[0]),), SEED), episodes=episodes)


def test_many_words_and_one_object_say_the_way_and_are_no_few_texts():
    for name, column in (("many words decide", "instruction"),
                         ("a part of one object decides", "ep_meta")):  # fmt: skip
        recording = small("pushing", name, episodes=60)
        texts = [str(e.facts[column]) for e in recording.episodes]
        assert len(set(texts)) > 12
        left = np.array(["left" in text for text in texts])
        assert np.array_equal(left, recording.modes == 0)
        assert [a.cause for a in recording.truth.answers()] == ["hidden_state"]


@pytest.mark.parametrize("base", ["pushing", "planner"])
def test_a_tool_that_points_down_has_two_numbers_for_one_rotation(base):
    clean = small(base)
    for name, width in (("a tool's roll at half a turn", 3),
                        ("commanded quaternions of either sign", 4)):  # fmt: skip
        recording = small(base, name)
        assert recording.truth == clean.truth
        added = np.concatenate([e.action[:, -width:] for e in recording.episodes])
        if width == 3:
            assert np.ptp(added[:, 0]) > 6.0 and np.ptp(added[:, 0] % (2 * np.pi)) < 0.4
        else:
            assert np.linalg.norm(added, axis=1) == pytest.approx(1.0)
            first = np.stack([e.action[0, -width:] for e in recording.episodes])
            assert 0 < np.count_nonzero(first[:, 0] < 0.0) < len(first)
        for before, after in zip(clean.episodes, recording.episodes, strict=True):
            assert np.array_equal(before.action, after.action[:, :-width])
