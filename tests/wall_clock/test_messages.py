"""What is said over the channels: there and back bit for bit, and nothing else."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from genpolicy.wall_clock.channel import MAXIMUM_PAYLOAD_BYTES
from genpolicy.wall_clock.messages import (
    LONGEST_NAME,
    MOST_ROWS,
    Answer,
    Ask,
    Operator,
    Order,
    read_answer,
    read_operator,
)

ANSWER = Answer("session/0", "c", "s", "flow", np.arange(20.0).reshape(2, 10))


def test_an_ask_comes_back_bit_for_bit():
    ask = Ask("session/0", np.random.default_rng(0).normal(size=(2, 24)), ("episode", "3"))
    back = Ask.decoded(ask.encoded())
    assert (back.invocation, back.noise) == (ask.invocation, ask.noise)
    assert back.observations.tobytes() == ask.observations.tobytes()


@pytest.mark.parametrize("value", [np.nan, np.inf, -0.0, 5e-324])
def test_actions_come_back_bit_for_bit_finite_or_not(value):
    """What is no number must reach the first layer, which rejects it."""
    answer = Answer(**{**vars(ANSWER), "actions": np.full((16, 10), value)})
    back = read_answer(answer.encoded())
    assert back is not None and back.actions.tobytes() == answer.actions.tobytes()


def test_the_longest_chunk_fits_a_frame():
    answer = Answer(**{**vars(ANSWER), "actions": np.zeros((MOST_ROWS, 10))})
    assert len(answer.encoded()) <= MAXIMUM_PAYLOAD_BYTES


def changed(**changes: object) -> bytes:
    return json.dumps(json.loads(ANSWER.encoded()) | changes).encode()


@pytest.mark.parametrize(
    "data",
    [
        b"", b"{}", b"[]", b"null", b"3", b"\xff\xfe", b"[" * 10_000, b"NaN",
        changed(rows=3), changed(rows=0), changed(rows=-2), changed(rows=True),
        changed(rows=MOST_ROWS + 1),
        Answer("0", "c", "s", "m", np.zeros((MOST_ROWS + 1, 2))).encoded(),
        changed(columns=0), changed(columns=1000),
        changed(rows="2"), changed(actions="zz"), changed(actions="00"), changed(actions=[1]),
        changed(invocation=3), changed(invocation=None), changed(method="x" * (LONGEST_NAME + 1)),
        changed(task_phase="insert"), changed(valid_until_s=1e9), changed(order="reset"),
        ANSWER.encoded()[:-3], ANSWER.encoded() * 2,
    ],
)  # fmt: skip
def test_what_is_no_answer_is_none(data):
    assert read_answer(changed()) is not None
    assert read_answer(data) is None


@given(st.binary(max_size=200))
def test_reading_never_raises(data):
    assert read_answer(data) is None and read_operator(data) is None


@pytest.mark.parametrize("order", Order)
def test_a_person_is_understood(order):
    assert read_operator(Operator(order, "spotter").encoded()) == Operator(order, "spotter")


@pytest.mark.parametrize(
    "said", [{}, {"order": "lift_limits", "person": "x"}, {"order": "reset", "person": 3}, 3]
)
def test_nobody_else_is(said):
    assert read_operator(json.dumps(said).encode()) is None
