"""What the tests of the executor do again and again: begin a chunk, judge the end."""

from genpolicy.verification.checker import check_messages


def judged(rig):
    events = rig.end()
    report = check_messages(
        (e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload}) for e in events
    )
    assert {violation.rule for violation in report.violations} == {"settings.checks"}
    assert report.checks_missing == {"issued"}  # the rig's chunks are imitations, and it says so
    assert rig.executor.conservation().error == 0
    assert rig.stub.stale == rig.stub.invalid == 0  # the executor saw it first
    return report


def begin(rig, ticks=2):
    rig.observe()
    rig.deliver(rig.chunk())
    rig.tick(ticks)
