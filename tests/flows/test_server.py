"""The Prefect server: a silent one is given up, a slow one is not."""

import threading
from collections.abc import Iterator

from flows import server


class Asked:
    """A server by a clock of its own: each question takes a while and has the next answer."""

    def __init__(self, answers: Iterator[bool], *, lasts_s: float, enough: int) -> None:
        self.answers, self.lasts_s, self.enough = answers, lasts_s, enough
        self.now_s, self.questions = 0.0, 0
        self.given_up: list[float] = []
        self.ended = threading.Event()

    def answer(self, _: str) -> bool:
        self.now_s += self.lasts_s
        self.questions += 1
        if self.questions >= self.enough:
            self.ended.set()
        return next(self.answers)

    def give_up(self, _: str) -> None:
        self.given_up.append(self.now_s)
        self.ended.set()

    def watch(self, silence_s: float) -> None:
        with server.watch_server(
            "u", silence_s=silence_s, period_s=0.001, answers=self.answer, give_up=self.give_up,
            clock=lambda: self.now_s,
        ) as watch:  # fmt: skip
            self.ended.wait()
        watch._thread.join()


def test_a_silent_server_is_given_up_once_and_not_before() -> None:
    silent = Asked(iter(lambda: False, True), lasts_s=0.125, enough=1000)
    silent.watch(silence_s=0.5)
    assert silent.given_up == [0.5]
    assert silent.questions == 4


def test_a_slow_server_is_not_given_up() -> None:
    slow = Asked(iter([False, False, False, True] * 100), lasts_s=0.125, enough=200)
    slow.watch(silence_s=0.5)
    assert slow.given_up == []


def test_silence_counts_from_the_last_answer() -> None:
    later = Asked(iter([False, False, False, True, *[False] * 9]), lasts_s=0.125, enough=1000)
    later.watch(silence_s=0.5)
    assert later.given_up == [1.0]


def test_the_limits_on_silence_leave_a_minute_untouched() -> None:
    assert server.SILENCE_S + server.PROBE_PERIOD_S + server.FIRST_ANSWER_S < 60
