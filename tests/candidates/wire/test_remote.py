import itertools
import threading

import numpy as np
import pytest

from genpolicy.candidates.wire import remote
from genpolicy.candidates.wire.connection import Connection, dial
from genpolicy.candidates.wire.extension import WORD
from genpolicy.candidates.wire.faults import Fault, PolicyError
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.errors import ContractError

CAN = {
    "version": 1, "checkpoint": "a" * 64, "sampler": "b" * 64, "prediction_horizon": 16,
    "seeded": True, "candidates": 3, "counts_evaluations": True, "spans": ["sample"],
}  # fmt: skip


class Planted:
    """Answers with the observation's newest place; remembers what it was asked."""

    def __init__(self, **can):
        self.can = {**CAN, **can}
        self.asked = []
        self.changes = {}

    def __call__(self, message):
        self.asked.append(message)
        said = message.get(WORD)
        number = said["candidates"] if said else 1
        chunk = np.zeros((number, 16, 10))
        chunk[..., :3] = message["observation"][-1, :3]
        chunk[..., [3, 7]] = 1.0
        answer = {"actions": chunk if said else chunk[0]}
        if said:
            answer[WORD] = {
                "invocation": said["invocation"], "checkpoint": self.can["checkpoint"],
                "sampler": self.can["sampler"], "nfe": 4, "spans_s": {"sample": 0.5},
            } | self.changes  # fmt: skip
        return answer


@pytest.fixture
def line(serving, entry, task):
    """A policy on a planted server, and the server."""
    opened = []

    def open_line(planted, metadata=None, entry=entry):
        context = serving(planted, {WORD: planted.can} if metadata is None else metadata)
        address = context.__enter__()
        policy = RemotePolicy(entry, address, task.observation)
        opened.append((context, policy))
        return policy

    yield open_line
    for context, policy in opened:
        policy.close()
        context.__exit__(None, None, None)


@pytest.fixture
def seen(task):
    return np.arange(2.0 * task.observation.dim).reshape(2, -1)


def test_candidates_come_in_as_many_messages_as_it_needs(line, seen):
    planted = Planted()
    found = line(planted).invoke(seen, noise=("a", 1), candidates=8)
    assert found.actions.shape == (8, 16, 10)
    np.testing.assert_array_equal(found.actions[..., :3], np.broadcast_to(seen[-1, :3], (8, 16, 3)))
    said = [message[WORD] for message in planted.asked]
    assert [one["candidates"] for one in said] == [3, 3, 2]
    assert [one["noise"] for one in said] == [
        ["a", 1],
        ["a", 1, "further", 3],
        ["a", 1, "further", 6],
    ]
    assert len({one["invocation"] for one in said}) == 3
    assert found.evaluations == 4
    assert found.spans_s == {"sample": 1.5}
    assert found.seconds > 0.0
    assert found.messages == 3


def test_a_plain_server_is_asked_once_for_each_and_never_sees_the_extension(line, seen, entry_of):
    planted = Planted()
    policy = line(planted, metadata={}, entry=entry_of(constants={"prompt": "insert"}))
    found = policy.invoke(seen, noise=("a", 1), candidates=3)
    assert found.actions.shape == (3, 16, 10)
    assert [sorted(message) for message in planted.asked] == [["observation", "prompt"]] * 3
    assert (found.evaluations, found.spans_s) == (None, {})


def test_after_a_fault_it_dials_again(line, seen):
    planted = Planted()
    policy = line(planted)
    planted.changes = {"invocation": "another"}
    with pytest.raises(PolicyError) as error:
        policy.invoke(seen, noise=("a",), candidates=1)
    assert error.value.fault is Fault.UNREQUESTED
    planted.changes = {}
    assert policy.invoke(seen, noise=("a",), candidates=1).actions.shape == (1, 16, 10)


def test_a_late_answer_is_never_taken_for_the_next_one(line, seen, monkeypatch):
    """Three answers that come after nobody waits for them, then one in time: to its question."""
    given_up = [threading.Event() for _ in range(3)]
    number, ask = itertools.count(), Connection.ask
    monkeypatch.setattr(Connection, "ask", lambda self, message, timeout_s: ask(
        self, message, timeout_s=0.05 if next(number) < len(given_up) else 60.0
    ))  # fmt: skip

    class Slow(Planted):
        def __call__(self, message):
            answer = super().__call__(message)
            if len(self.asked) <= len(given_up):
                given_up[len(self.asked) - 1].wait(60)
            return answer

    policy = line(Slow(), metadata={})
    for late, over in enumerate(given_up):
        with pytest.raises(PolicyError) as error:
            policy.invoke(seen + late, noise=("a",), candidates=1)
        assert error.value.fault is Fault.LATE
        over.set()
    found = policy.invoke(seen + 100.0, noise=("a",), candidates=1)
    np.testing.assert_array_equal(found.actions[0, 0, :3], seen[-1, :3] + 100.0)


def test_a_server_that_became_another_is_refused_when_it_is_dialled_again(line, seen):
    planted = Planted()
    metadata = {WORD: dict(planted.can)}
    policy = line(planted, metadata=metadata)
    policy.close()
    metadata[WORD]["checkpoint"] = "c" * 64
    with pytest.raises(PolicyError, match="others than at first") as error:
        policy.invoke(seen, noise=("a",), candidates=1)
    assert error.value.fault is Fault.CHANGED


@pytest.mark.parametrize(
    ("can", "fault"),
    [({"checkpoint": 5}, Fault.MALFORMED), ({"seeded": False}, Fault.CHANGED)],
)
def test_a_line_that_is_dialled_again_and_begins_wrongly_is_hung_up(
    line, seen, monkeypatch, can, fault
):
    """Wrong before: each invocation left a socket and its thread behind, until none was left."""
    planted = Planted()
    metadata, dialled = {WORD: dict(planted.can)}, []
    policy = line(planted, metadata=metadata)
    policy.close()
    metadata[WORD] |= can

    def kept(*given, **named):
        dialled.append(dial(*given, **named))
        return dialled[-1]

    monkeypatch.setattr(remote, "dial", kept)
    for ask in (lambda: policy.invoke(seen, noise=("a",), candidates=1), policy.round_trip_s):
        with pytest.raises(PolicyError) as error:
            ask()
        assert error.value.fault is fault
    for one in dialled:
        one._socket.recv_events_thread.join(10)  # far more than hanging up takes
    assert [one._socket.socket.fileno() for one in dialled] == [-1, -1]


@pytest.mark.parametrize(
    ("shape", "found"),
    [((1, 15, 10), "15 actions of 10"), ((1, 17, 10), "17 actions"), ((1, 16, 9), "9 numbers")],
)
def test_chunks_of_another_shape_than_declared_are_a_fault(line, seen, shape, found):
    class Wrong(Planted):
        def __call__(self, message):
            return super().__call__(message) | {"actions": np.zeros(shape)}

    with pytest.raises(PolicyError, match=found) as error:
        line(Wrong()).invoke(seen, noise=("a",), candidates=1)
    assert error.value.fault is Fault.SHAPE


def test_another_horizon_than_declared_is_a_fault_at_once(line):
    with pytest.raises(PolicyError, match="predicts 8 actions, its entry says 16") as error:
        line(Planted(prediction_horizon=8))
    assert error.value.fault is Fault.SHAPE


def test_more_columns_than_have_a_meaning_are_none_of_our_business(line, seen):
    class Wide(Planted):
        def __call__(self, message):
            answer = super().__call__(message)
            return answer | {"actions": np.pad(answer["actions"], ((0, 0), (0, 0), (0, 22)))}

    assert line(Wide()).invoke(seen, noise=("a",), candidates=1).actions.shape == (1, 16, 10)


def test_an_entry_of_other_channels_is_refused_before_anybody_is_asked(entry_of, task):
    wrong = entry_of(observation={"state": {"channels": ["joint_position_rad"]}})
    with pytest.raises(ContractError, match="joint_position_rad"):
        RemotePolicy(wrong, "ws://127.0.0.1:1", task.observation)
