"""A journal on disk as it grows: what a killed process leaves is read as far as it is whole."""

import pytest

from genpolicy.evidence.shadow.rig import rig_cell
from genpolicy.execution.executor import Executor
from genpolicy.execution.journal import read_journal
from genpolicy.execution.stub import ControllerStub
from genpolicy.execution.supervisor import Supervisor
from genpolicy.verification.checker import check_journal
from genpolicy.wall_clock.streamed import (
    JOURNAL,
    StreamedJournal,
    collect,
    recovered,
    session_file,
    sessions_of,
    stop_may_stand,
)


def played(path, *, ticks=5, stop=False):
    journal, cell = StreamedJournal("rig/0", path, {"method": "rig"}), rig_cell()
    stub = ControllerStub(cell, journal, Supervisor(cell.execution, journal))
    executor = Executor(cell, journal, stub)
    for tick in range(ticks):
        executor.observe(tick * 0.05, tick * 0.05, "approach", "epoch-1")
        executor.tick(tick * 0.05)
    if stop:
        executor.stub.supervisor.emergency_stop(ticks * 0.05)
    return executor, journal


def end(executor, journal):
    executor.end_episode(10.0)
    journal.flush()
    journal.close()


def test_what_is_read_back_is_what_was_added(tmp_path):
    executor, journal = played(session_file(tmp_path, 0))
    end(executor, journal)
    assert recovered(session_file(tmp_path, 0)) == journal.events()
    assert read_journal(session_file(tmp_path, 0)) == {"rig/0": journal.events()}  # whole MCAP
    assert check_journal(collect(tmp_path)).violations == []
    assert not journal.lost


def test_a_file_cut_anywhere_gives_its_whole_events(tmp_path):
    executor, journal = played(session_file(tmp_path, 0))
    end(executor, journal)
    data, cut, sizes = session_file(tmp_path, 0).read_bytes(), tmp_path / "cut.mcap", []
    for size in range(0, len(data), 97):
        cut.write_bytes(data[:size])
        events = recovered(cut)
        assert events == journal.events()[: len(events)]
        sizes.append(len(events))
    assert sizes == sorted(sizes) and sizes[0] == 0 and sizes[-1] == len(journal)


def test_what_was_flushed_is_there_without_any_end(tmp_path):
    _, journal = played(session_file(tmp_path, 0))
    journal.flush()
    assert recovered(session_file(tmp_path, 0)) == journal.events()
    found = {violation.rule for violation in check_journal(collect(tmp_path)).violations}
    assert found == {"journal.no_end"}


def test_sessions_of_a_folder_are_one_journal(tmp_path):
    end(*played(session_file(tmp_path, 0)))
    path = session_file(tmp_path, 1)
    journal = StreamedJournal("rig/1", path)
    journal.add("hold", 0, {"reason": "empty"})
    journal.flush()
    assert [len(events) > 0 for events in sessions_of(tmp_path)] == [True, True]
    assert set(read_journal(collect(tmp_path))) == {"rig/0", "rig/1"}
    assert collect(tmp_path) == tmp_path / JOURNAL


@pytest.mark.parametrize(
    ("stop", "ends", "stands"),
    [(False, True, False), (True, True, True), (False, False, True), (True, False, True)],
)
def test_a_stop_that_stood_and_an_end_that_is_missing_leave_a_stop(stop, ends, stands, tmp_path):
    executor, journal = played(session_file(tmp_path, 0), stop=stop)
    if ends:
        executor.end_episode(10.0)
    journal.flush()
    assert stop_may_stand(recovered(session_file(tmp_path, 0))) is stands


def test_a_cleared_stop_does_not_stand(tmp_path):
    executor, journal = played(session_file(tmp_path, 0), stop=True)
    executor.stub.supervisor.human_reset(0.3, "spotter")
    end(executor, journal)
    assert not stop_may_stand(recovered(session_file(tmp_path, 0)))


def test_an_empty_session_leaves_a_stop(tmp_path):
    session_file(tmp_path, 0).write_bytes(b"")
    assert sessions_of(tmp_path) == [[]] and stop_may_stand([])


def test_a_file_that_fails_is_said_and_nothing_raises(tmp_path):
    _, journal = played(session_file(tmp_path, 0))
    journal._file.close()
    journal.add("hold", 1, {"reason": "empty"})
    journal.flush()
    journal.close()
    assert "ValueError" in journal.lost and journal.events()[-1].kind == "hold"


def test_another_session_is_never_written_over(tmp_path):
    played(session_file(tmp_path, 0))
    with pytest.raises(FileExistsError):
        StreamedJournal("again", session_file(tmp_path, 0))
