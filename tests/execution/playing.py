"""What the tests of the executor do again and again: begin a chunk, judge the end."""

from genpolicy.execution.cell import FALLBACK_HASH
from genpolicy.execution.recovery import fallback_metadata
from genpolicy.verification.checker import check_messages


def checked(events):
    """What the independent checker says of a session."""
    return check_messages(
        (e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload}) for e in events
    )


def judged(rig):
    report = checked(rig.end())
    assert {violation.rule for violation in report.violations} == {"settings.checks"}
    assert report.checks_missing == {"issued"}  # the rig's chunks are imitations, and it says so
    assert rig.executor.conservation().error == 0
    assert rig.stub.stale == rig.stub.invalid == 0  # the executor saw it first
    return report


def begin(rig, ticks=2):
    rig.observe()
    rig.deliver(rig.chunk())
    rig.tick(ticks)


def fall_back(rig, recovery, *, ticks):
    """The fallback takes over, and some of its chunk is commanded."""
    rig.executor.begin_fallback(rig.now_s)
    rig.tick(5)
    recovery.advance(rig.now_s)
    rig.observe()
    metadata = fallback_metadata(
        rig.executor, now_s=rig.now_s, chunk_id="way back", event_time_s=rig.now_s,
        phase=rig.phase, epoch=rig.epoch,
    )  # fmt: skip
    assert metadata.policy_checkpoint_hash == FALLBACK_HASH
    chunk = rig.chunk()  # its context rests, as the arm does after a hold
    rig.executor.deliver_fallback(rig.remade(chunk, metadata, chunk.actions), rig.now_s)
    rig.tick(ticks)
