"""The Prefect server: a silent one is given up, a slow one is not."""

import threading
import time

from flows import server


def test_a_silent_server_is_given_up_once_and_a_slow_one_is_not() -> None:
    given_up = threading.Event()
    started = time.monotonic()
    calls: list[str] = []

    def give_up(url: str) -> None:
        calls.append(url)
        given_up.set()

    with server.watch_server(
        "u", silence_s=0.3, period_s=0.02, answers=lambda _: False, give_up=give_up
    ):
        assert given_up.wait(10)
        assert time.monotonic() - started >= 0.3
        time.sleep(0.1)
    assert calls == ["u"]

    answers = iter([False, False, True] * 1000)
    calls.clear()
    with server.watch_server(
        "u", silence_s=0.5, period_s=0.02, answers=lambda _: next(answers), give_up=calls.append
    ):
        time.sleep(1.0)
    assert calls == []


def test_the_limits_on_silence_leave_a_minute_untouched() -> None:
    assert server.SILENCE_S + server.PROBE_PERIOD_S + server.FIRST_ANSWER_S < 60
