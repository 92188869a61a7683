"""Journals as files: damaged, empty, or several sessions in one."""

import json

import pytest
from mcap.writer import Writer

from genpolicy.errors import BadInputError
from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.verification.checker import check_journal


def test_sessions_of_one_file_are_checked_apart(tmp_path):
    rigs = [Rig(session=f"rollout-{n}") for n in range(3)]
    for rig in rigs:
        rig.run()
        rig.end()
    path = tmp_path / "journal.mcap"
    write_journal(path, [rig.journal for rig in rigs])
    report = check_journal(path)
    assert (report.sessions, report.checked_actions) == (3, 24)
    assert {violation.rule for violation in report.violations} == {"settings.checks"}


def test_a_damaged_file_is_refused_not_believed(tmp_path):
    path = tmp_path / "journal.mcap"
    rig = Rig()
    for _ in range(20):
        rig.run()
    rig.end()
    write_journal(path, [rig.journal])
    whole = path.read_bytes()
    for cut in range(0, len(whole), len(whole) // 20):
        path.write_bytes(whole[:cut])
        with pytest.raises(BadInputError, match="whole MCAP journal"):
            check_journal(path)
    silent = 0
    for at in range(8, len(whole), len(whole) // 150):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 4]) + whole[at + 1 :])
        try:
            report = check_journal(path)
        except BadInputError:
            continue
        # A flip may hit bytes that carry no event; then exactly the same events were read. In
        # the index it renames a topic; then the events of that topic are refused one by one.
        found = {violation.rule for violation in report.violations} - {"settings.checks"}
        silent += not found and report.checked_actions != 160
    assert silent == 0


def test_an_empty_journal_proves_nothing(tmp_path):
    path = tmp_path / "journal.mcap"
    write_journal(path, [Journal("empty")])
    report = check_journal(path)
    assert report.sessions == 0 and report.checked_actions == 0


@pytest.mark.parametrize(("n", "t"), [(0, "0"), (0, 0.0), (0, False), ("0", 0), (None, 0)])
def test_a_number_or_a_time_that_is_no_whole_number_is_refused(tmp_path, n, t):
    path = tmp_path / "journal.mcap"
    writer = Writer(str(path))
    writer.start()
    schema = writer.register_schema("s", "jsonschema", b"{}")
    channel = writer.register_channel("/journal/hold", "json", schema)
    event = json.dumps({"session": "s", "n": n, "t": t, "reason": "empty"}).encode()
    writer.add_message(channel, log_time=0, data=event, publish_time=0)
    writer.finish()
    with pytest.raises(BadInputError, match="whole MCAP journal"):
        check_journal(path)
