"""Whatever is said to a session, nothing raises, what must stop stops, and its journal is written.

Values are worse than wrong: asking what they are raises, or hashing or comparing them does. A
policy process sends no such thing; a fault in the program that wraps it may.
"""

import decimal
import fractions
import math
import weakref
from numbers import Real
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.contract.chunk import ChunkMetadata, DiscardReason
from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.journal import read_journal, write_journal


class Gone:
    """What a dead reference pointed to."""


class Unhashable(str):
    """A text that cannot be looked up."""

    __hash__ = None


class Compared:
    """What cannot be compared."""

    __hash__ = object.__hash__

    def __eq__(self, other):
        raise RuntimeError("compared")


class Converted(float):
    """A number that cannot be read."""

    def __float__(self):
        raise RuntimeError("read")

    __le__ = __lt__ = __ge__ = __gt__ = __float__


class Registered:
    """Said to be a number, and none."""

    def __float__(self):
        raise ValueError("none")


Real.register(Registered)


class Asked:
    """What raises when it is asked what it is."""

    @property
    def __class__(self):
        raise RuntimeError("asked")


class Printed:
    """What cannot be printed."""

    def __str__(self):
        raise RuntimeError("printed")

    __repr__ = __str__


class Anything:
    """Equal to whatever it is compared with."""

    __hash__ = object.__hash__

    def __eq__(self, other):
        return True


def _dead():
    gone = Gone()
    return weakref.proxy(gone)


def _unbuilt(**fields):
    metadata = object.__new__(ChunkMetadata)
    for name, value in fields.items():
        object.__setattr__(metadata, name, value)
    return metadata


WRONG = {
    "nan": math.nan, "infinite": math.inf, "none": None, "text": "now", "dead": _dead(),
    "unhashable": Unhashable("approach"), "compared": Compared(), "converted": Converted(1.0),
    "registered": Registered(), "asked": Asked(), "printed": Printed(),
    "array": np.array([1.0, 2.0]), "objects": np.array([None, 1], dtype=object), "list": [1],
    "mapping": {}, "anything": Anything(), "signalling": decimal.Decimal("sNaN"),
    "huge": fractions.Fraction(10**400), "whole": 10**400, "flag": True, "surrogate": "\ud800",
    "bytes": b"x", "complex": 1j, "no_date": np.datetime64("NaT"), "function": _dead,
    "unbuilt": _unbuilt(), "named_only": _unbuilt(chunk_id="c9"),
}  # fmt: skip

SAID = {
    "tick": lambda r, v: r.executor.tick(v),
    "observed_now": lambda r, v: r.executor.observe(v, r.now_s, "approach", "epoch-1"),
    "observed_at": lambda r, v: r.executor.observe(r.now_s, v, "approach", "epoch-1"),
    "phase": lambda r, v: r.executor.observe(r.now_s, r.now_s, v, "epoch-1"),
    "epoch": lambda r, v: r.executor.observe(r.now_s, r.now_s, "approach", v),
    "divergence": lambda r, v: r.executor.observe(r.now_s, r.now_s, "approach", "epoch-1", v),
    "place": lambda r, v: r.executor.observe(r.now_s, r.now_s, "approach", "epoch-1", tcp_m=v),
    "part": lambda r, v: r.executor.observe(
        r.now_s, r.now_s, "approach", "epoch-1", tcp_m=[v, 0.0, 0.0]
    ),
    "scene": lambda r, v: r.executor.see(r.now_s, v),
    "body": lambda r, v: r.executor.see(r.now_s, {"post": (v, [1, 0, 0, 0])}),
    "checkpoint": lambda r, v: r.executor.set_active(r.now_s, v, "x"),
    "sampler": lambda r, v: r.executor.set_active(r.now_s, "x", v),
    "controller": lambda r, v: r.executor.controller(r.now_s, v),
    "begin": lambda r, v: r.executor.begin_invocation(r.now_s, v, v),
    "end": lambda r, v: r.executor.end_invocation(r.now_s, v, v),
    "chunk": lambda r, v: r.deliver(v),
    "metadata": lambda r, v: r.deliver(SimpleNamespace(actions=np.zeros((16, 10)), metadata=v)),
    "actions": lambda r, v: r.deliver(SimpleNamespace(actions=v, metadata=r.chunk().metadata)),
    "verdict": lambda r, v: r.deliver(r.chunk(verdict=v)),
    "context": lambda r, v: r.deliver(r.chunk(context=v)),
    "delivered_now": lambda r, v: r.executor.deliver(r.chunk(), v),
    "lost": lambda r, v: r.executor.write_off(v, 3, DiscardReason.EXPIRED, r.now_s),
    "rows": lambda r, v: r.executor.write_off(
        r.chunk().metadata, v, DiscardReason.EXPIRED, r.now_s
    ),
    "reason": lambda r, v: r.executor.write_off(r.chunk().metadata, 3, v, r.now_s),
    "reset": lambda r, v: r.executor.reset(v),
    "intervene": lambda r, v: r.executor.intervene(v),
    "hand_back": lambda r, v: r.executor.hand_back(v),
    "force_event": lambda r, v: r.executor.force_event(v),
    "collision_event": lambda r, v: r.executor.collision_event(v),
    "end_episode": lambda r, v: r.executor.end_episode(v),
    "poll": lambda r, v: r.stub.poll(v),
    "needs": lambda r, v: r.executor.needs_invocation(v),
}
STOPS = {
    "force_now": lambda r, v: r.supervisor.observe_force(v, 100.0, "approach"),
    "force_phase": lambda r, v: r.supervisor.observe_force(r.now_s, 100.0, v),
    "collision_now": lambda r, v: r.supervisor.observe_collision(v, True),
    "stop_now": lambda r, v: r.supervisor.emergency_stop(v),
    "stop_detail": lambda r, v: r.supervisor.emergency_stop(r.now_s, v),
}


def _said(say, value):
    rig = Rig()
    rig.run(1)
    say(rig, value)
    rig.tick(2)
    return rig


def _go_on(rig):
    rig.observe()
    rig.deliver(rig.chunk())
    rig.tick(2)


@pytest.mark.parametrize("name", SAID)
def test_nothing_that_is_said_raises_or_keeps_the_journal_from_being_written(name, tmp_path):
    path = tmp_path / "j.mcap"
    for value in WRONG.values():
        rig = _said(SAID[name], value)
        _go_on(rig)
        events = rig.end()
        write_journal(path, [rig.journal])
        assert len(read_journal(path)["rig"]) == len(events)


@pytest.mark.parametrize("name", STOPS)
def test_whatever_else_is_said_of_a_stop_it_stops(name, tmp_path):
    for value in WRONG.values():
        rig = _said(STOPS[name], value)
        assert rig.supervisor.stopped
        accepted = rig.stub.accepted
        _go_on(rig)
        assert rig.supervisor.stopped and rig.stub.accepted == accepted
        write_journal(tmp_path / "j.mcap", [rig.journal])


@pytest.mark.parametrize("value", [key for key in WRONG if key not in ("flag", "whole", "huge")])
def test_what_is_no_force_stops_and_what_is_no_flag_is_a_collision(value):
    for say in (
        lambda r: r.supervisor.observe_force(r.now_s, WRONG[value], "approach"),
        lambda r: r.supervisor.observe_collision(r.now_s, WRONG[value]),
    ):
        rig = Rig()
        rig.run(1)
        say(rig)
        assert rig.supervisor.stopped


@pytest.mark.parametrize("value", ["dead", "asked", "unhashable", "array", "nan", "none"])
def test_weights_that_have_no_name_may_command_nothing(value):
    """Not even a chunk that says it was made by weights without a name."""
    rig = Rig()
    rig.observe()
    rig.executor.set_active(rig.now_s, WRONG[value] if value != "unhashable" else "", "")
    rig.deliver(rig.chunk(policy_checkpoint_hash="", sampler_config_hash=""))
    rig.tick(2)
    assert rig.stub.accepted == 0
