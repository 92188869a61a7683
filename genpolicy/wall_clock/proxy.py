"""Between policy and supervisor: a line that delays, drops, doubles and overtakes, as planned.

`python -m genpolicy.wall_clock.proxy PLAN.json --asks FD --answers FD …`. The plan names, for a
message of an invocation, when each copy of it goes on: none is a message that is lost, two are one
that is doubled, and a long one is overtaken by the next. It knows nothing of what it passes on but
the name of the invocation.
"""

import argparse
import heapq
import select
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic import Field, NonNegativeFloat

from genpolicy.contract.settings import Settings
from genpolicy.integrity.documents import parse_json
from genpolicy.wall_clock.channel import Inbox, frame, send_all

AT_ONCE = (0.0,)
Delays = dict[str, tuple[NonNegativeFloat, ...]]


class LinePlan(Settings):
    """What happens on the way, by invocation, as `SESSION/NUMBER`; the rest goes on at once.

    Attributes:
        asks: To the policy: seconds until each copy goes on.
        answers: To the supervisor, likewise.
    """

    asks: Delays = Field(default_factory=dict)
    answers: Delays = Field(default_factory=dict)


def main(arguments: Sequence[str] | None = None) -> int:
    """Pass messages on until one side is gone and nothing is on its way. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="genpolicy.wall_clock.proxy")
    parser.add_argument("plan", type=Path)
    for name in ("asks", "answers", "ask-out", "answer-out"):
        parser.add_argument(f"--{name}", type=int, required=True, help="file descriptor")
    given = parser.parse_args(arguments)
    plan = LinePlan.model_validate_json(given.plan.read_bytes())
    asks, answers = Inbox(given.asks), Inbox(given.answers)
    lines = ((asks, plan.asks, given.ask_out), (answers, plan.answers, given.answer_out))
    waiting: list[tuple[float, int, int, bytes]] = []
    count = 0
    while waiting or not (asks.closed or answers.closed):
        left_s = max(0.0, waiting[0][0] - time.monotonic()) if waiting else None
        readable = [inbox.descriptor for inbox, _, _ in lines if not inbox.closed]
        select.select(readable, [], [], left_s)
        for inbox, delays, out in lines:
            for payload in () if inbox.closed else inbox.read():
                for delay_s in delays.get(_invocation(payload), AT_ONCE):
                    count += 1
                    due_s = time.monotonic() + delay_s
                    heapq.heappush(waiting, (due_s, count, out, frame(payload)))
        while waiting and waiting[0][0] <= time.monotonic():
            _, _, out, data = heapq.heappop(waiting)
            if not send_all(out, data):
                return 0
    return 0


def planned(delays: Mapping[tuple[int, int], Sequence[float]]) -> Delays:
    """Delays by session and number of the invocation, as a plan has them."""
    return {f"{session}/{number}": tuple(each) for (session, number), each in delays.items()}


def _invocation(payload: bytes) -> str:
    """Session and number of the invocation that a message is about; empty where it names none."""
    try:
        return "/".join(str(parse_json(payload, where="a message")["invocation"]).split("/")[-2:])
    except Exception:  # whatever somebody sends is passed on
        return ""


if __name__ == "__main__":
    sys.exit(main())
