"""A policy's process that keeps the arm where it was told to, and misbehaves on request.

It loads nothing of the task, so that it is up at once.
"""

import argparse
import json
import os
import select
import signal
import sys
import time

import numpy as np

from genpolicy.wall_clock.channel import HEADER, MAGIC, MAXIMUM_PAYLOAD_BYTES, Inbox, frame
from genpolicy.wall_clock.messages import Answer, Ask, Operator, Order

ROWS = 16


def send(descriptor: int, data: bytes) -> None:
    while data:
        data = data[os.write(descriptor, data) :]


def answer_to(ask: Ask, told: dict) -> Answer:
    """What is told to be answered: checkpoint, sampler, method, and an action for every row."""
    actions = np.tile(told["action"], (ROWS, 1))
    rest = {name: told[name] for name in ("checkpoint", "sampler", "method")}
    return Answer(invocation=ask.invocation, actions=actions, **rest)


def misbehave(behaviour: str, number: int, good: Answer, out: int) -> None:
    """What is sent for an invocation; the first is always answered well."""
    plain = frame(good.encoded())
    if number == 0 or behaviour == "good":
        send(out, plain)
    elif behaviour == "hang":
        signal.pause()
    elif behaviour == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    elif behaviour == "die_in_a_frame":
        send(out, plain[: len(plain) // 2])
        os.kill(os.getpid(), signal.SIGKILL)
    elif behaviour == "garbage":
        send(out, os.urandom(3000))
    elif behaviour == "no_json":
        send(out, frame(b"{") + frame(b"null") + frame(b"[" * 5000) + frame(b"\xff" * 100))
    elif behaviour == "oversize":
        send(out, HEADER.pack(MAGIC, MAXIMUM_PAYLOAD_BYTES + 1, 0) + b"x" * 200_000)
    elif behaviour == "nan":
        broken = np.full((ROWS, 10), np.nan)
        send(out, frame(answer_to_like(good, actions=broken).encoded()))
    elif behaviour == "other_weights":
        send(out, frame(answer_to_like(good, checkpoint="0" * 64).encoded()))
    elif behaviour == "one_row":
        send(out, frame(answer_to_like(good, actions=np.zeros((1, 3))).encoded()))
    elif behaviour == "operator":  # words of a person, from the policy
        send(out, frame(Operator(Order.RESET, "spotter").encoded()) + plain)
    elif behaviour == "late":
        time.sleep(2.0)  # beyond the slow deadline of `arranged`
        send(out, plain)
    else:
        raise SystemExit(f"no behaviour {behaviour}")


def answer_to_like(good: Answer, **changes) -> Answer:
    return Answer(**(vars(good) | changes))


def flood(inbox: Inbox, told: dict, out: int) -> None:
    """Answers well, and between answers fills the pipe with copies and noise, without end."""
    os.set_blocking(out, False)
    noise, number = frame(b"{}") + b"noise" + MAGIC, 0
    while not inbox.closed:
        for payload in inbox.read():
            os.set_blocking(out, True)
            copy = frame(answer_to(Ask.decoded(payload), told).encoded())
            send(out, copy * 50)
            os.set_blocking(out, False)
            number += 1
        try:
            os.write(out, noise * 100)
        except BlockingIOError:
            select.select([], [out], [], 0.01)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("behaviour")
    parser.add_argument("told", type=json.loads)
    parser.add_argument("--asks", type=int)
    parser.add_argument("--answers", type=int)
    parser.add_argument("--ready", type=int)
    given = parser.parse_args()
    told, inbox, number = given.told, Inbox(given.asks), 0
    if given.ready is not None:
        os.write(given.ready, b".")
        os.close(given.ready)
    if given.behaviour == "flood":
        flood(inbox, told, given.answers)
        return
    while not inbox.closed:
        select.select([inbox.descriptor], [], [])
        for payload in inbox.read():
            good = answer_to(Ask.decoded(payload), told)
            misbehave(given.behaviour, number, good, given.answers)
            number += 1


if __name__ == "__main__":
    try:
        main()
    except BrokenPipeError:
        sys.exit(0)
