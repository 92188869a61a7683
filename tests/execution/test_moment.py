"""What a question is asked about: views after events and observations, facts that are missing."""

import pytest

from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.moment import Moment, View

FORCE = DiscardReason.FORCE_EVENT


def test_a_later_event_covers_an_earlier_one_and_never_the_reverse() -> None:
    view = View().voided(FORCE, 10, 3)
    assert view.voided(FORCE, 5, 2) is view
    assert tuple(view.voided(FORCE, 5, 7).voidings[FORCE]) == (10, 7)
    assert view.voidings.keys() == {FORCE}


def test_a_place_without_chunk_or_row_cannot_be_asked_about_one() -> None:
    with pytest.raises(AssertionError, match="no chunk"):
        _ = Moment(now_ns=0).chunk
    with pytest.raises(AssertionError, match="no row"):
        _ = Moment(now_ns=0).due_ns


@pytest.mark.parametrize(("event_ns", "newest_ns", "why"), [
    (100, 100, ""), (150, 100, ""), (200, 100, ""), (99, 100, "older"), (201, 100, "future"),
    (0, None, ""), (201, None, "future"),
])  # fmt: skip
def test_an_observation_is_used_unless_older_than_the_newest_or_from_the_future(
    event_ns, newest_ns, why
):
    assert View(newest_observation_ns=newest_ns).ignores(event_ns, 200) == why


def waiting():
    """A chunk that is due now, for the phase that was observed last."""
    rig = Rig()
    rig.advance(0.5)
    rig.observe()
    assert rig.deliver(rig.chunk()) is None
    return rig


def told(rig, event_ns):
    """The stub's own ears; whoever drives it may be wrong."""
    rig.stub.note_observation(rig.now_ns, event_ns, "insert", rig.epoch)


def told_executor(rig, event_ns):
    rig.stub.note_observation = lambda *_, **__: None
    rig.executor.observe(rig.now_s, event_ns / 1e9, "insert", rig.epoch)


@pytest.mark.parametrize("offset_ns", [-1_000, 1_000])
@pytest.mark.parametrize("tell", [told, told_executor])
def test_stub_and_executor_each_ask_it(tell, offset_ns):
    """The phase of what is not used is not believed: the chunk for the other one still moves."""
    rig = waiting()
    tell(rig, rig.now_ns + offset_ns)
    assert rig.tick()[0].kind == "action"
    rig = waiting()
    tell(rig, rig.now_ns)  # as new as the newest: it is used, and its phase is another
    assert rig.tick()[0].kind == "hold"


def test_both_ask_the_same_question(monkeypatch):
    monkeypatch.setattr(View, "ignores", lambda *_: "older")
    for tell in (told, told_executor):
        rig = Rig()
        tell(rig, rig.now_ns)
        views = (rig.executor._view, rig.stub._view)
        assert [view.newest_observation_ns for view in views] == [None, None]
