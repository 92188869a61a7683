"""How far the work is: few lines in a log, with the time left; a stage that is alive says so."""

import sys
import threading

import pytest

from genpolicy.progress import STAGE, ProgressLine, counting, duration, still_at_it


@pytest.fixture(autouse=True)
def _no_stage(monkeypatch):
    monkeypatch.delenv(STAGE, raising=False)


def test_progress_prints_few_lines_in_a_log(capsys):
    now = [0.0]
    line = ProgressLine("episodes", clock=lambda: now[0])
    for done in range(1, 101):
        now[0] += 0.5
        line(done, 100)
    line.close()
    printed = capsys.readouterr().err.splitlines()
    assert printed[0] == "episodes: 20 of 100, about 40 s left"
    assert len(printed) == 4


def test_a_stage_is_named_to_all_its_processes(capsys, monkeypatch):
    monkeypatch.setenv(STAGE, "[5/19] train_baselines")
    now = [0.0]
    line = ProgressLine("act, update", clock=lambda: now[0])
    now[0] = 60.0
    line(900, 8100)
    assert capsys.readouterr().err == (
        "[5/19] train_baselines · act, update: 900 of 8100, about 8 min left\n"
    )
    now[0] = 120.0
    line(7, None)
    assert capsys.readouterr().err == "[5/19] train_baselines · act, update: 7\n"


def test_what_is_counted_is_counted_whole_and_said_now_and_then(capsys):
    now = iter([0.0, 0.0, 9.0, 18.0, 27.0])
    assert list(counting(4, "updates", clock=lambda: next(now))) == [0, 1, 2, 3]
    assert capsys.readouterr().err.splitlines() == [
        "updates: 2 of 4, about 18 s left",
    ]


def test_a_terminal_has_one_line_that_is_written_over(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    now = [0.0]
    line = ProgressLine("episodes", clock=lambda: now[0])
    for done in (1, 2):
        now[0] += 1.0
        line(done, 2)
    assert "\n" not in capsys.readouterr().err
    line.close()
    line.close()
    assert capsys.readouterr().err == "\r\x1b[K"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(-1.0, "0 s"), (89.4, "89 s"), (90.0, "2 min"), (5400.0, "1 h 30 min")],
)
def test_a_time_is_said_as_a_person_says_it(seconds, text):
    assert duration(seconds) == text


@pytest.mark.parametrize(
    ("usual_s", "said"),
    [(None, "for 30 s"), (90.0, "for 30 s, about 60 s left by the last run"),
     (20.0, "for 30 s; it took 20 s last time")],
)  # fmt: skip
def test_a_stage_that_is_alive_says_so_and_stops_with_its_work(capsys, usual_s, said):
    asked, spoken = [], threading.Event()

    def clock():
        asked.append(None)
        if len(asked) > 2:  # what it was asked for before has been said by now
            spoken.set()
        return 30.0 if len(asked) > 1 else 0.0

    with still_at_it(usual_s, clock=clock, every_s=0.001):
        assert spoken.wait(60)
    first, *_ = capsys.readouterr().err.splitlines()
    assert first == said
    assert all(thread.name != "progress" for thread in threading.enumerate())


def test_work_that_fails_ends_it_too():
    with pytest.raises(RuntimeError, match="broken"), still_at_it(None, every_s=60.0):
        raise RuntimeError("broken")
    assert all(thread.name != "progress" for thread in threading.enumerate())
