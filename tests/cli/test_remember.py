"""Answers that are kept: asked once, also after an interruption in the middle of a line."""

import numpy as np
import pytest

from genpolicy.cli.remember import Answers, remembered_admissible, remembered_replay


def test_an_episode_is_replayed_once_also_by_the_next_command(tmp_path):
    asked = []

    def replay(uuid):
        asked.append(uuid)
        return "success"

    path = tmp_path / "work" / "answers.jsonl"
    for _ in range(2):
        again = remembered_replay(replay, Answers(path))
        assert [again("a"), again("b"), again("a")] == ["success"] * 3
    assert asked == ["a", "b"]


def test_a_chunk_is_known_by_its_numbers_and_its_observation(tmp_path):
    asked = []

    def admissible(actions, observation):
        asked.append(float(actions.sum() + observation.sum()))
        return len(asked) > 1, "" if len(asked) > 1 else "collision"

    path = tmp_path / "answers.jsonl"
    check = remembered_admissible(admissible, Answers(path))
    chunk, here = np.ones((4, 2)), np.zeros(3)
    assert check(chunk, here) == (False, "collision")
    assert check(chunk, here + 1.0) == (True, "")
    check = remembered_admissible(admissible, Answers(path))
    assert check(chunk.copy(order="F"), here) == (False, "collision")
    assert len(asked) == 2


@pytest.mark.parametrize("cut", [1, 7, 20])
def test_a_line_that_was_cut_off_is_asked_again(tmp_path, cut):
    path = tmp_path / "answers.jsonl"
    answers = Answers(path)
    answers.ask("one", lambda: "first")
    answers.ask("two", lambda: "second")
    path.write_bytes(path.read_bytes()[:-cut])
    again = Answers(path)
    assert again.ask("one", lambda: "other") == ("first" if cut < 20 else "other")
    assert again.ask("two", lambda: "new") == "new"
    assert Answers(path).ask("two", lambda: "newer") == "new"
