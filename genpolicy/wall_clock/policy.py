"""The policy's process: `python -m genpolicy.wall_clock.policy CHECKPOINT SHA256 --asks FD …`.

It answers what it is asked, one candidate each, and is trusted with nothing.
"""

import argparse
import os
import select
import sys
from collections.abc import Sequence
from pathlib import Path

from genpolicy.policies.policy import load_policy
from genpolicy.wall_clock.channel import Inbox, frame
from genpolicy.wall_clock.messages import Answer, Ask


def main(arguments: Sequence[str] | None = None) -> int:
    """Answer until nobody asks any more. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="genpolicy.wall_clock.policy")
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("sha256")
    for name in ("asks", "answers"):
        parser.add_argument(f"--{name}", type=int, required=True, help="file descriptor")
    given = parser.parse_args(arguments)
    policy = load_policy(given.checkpoint, expected_sha256=given.sha256)
    inbox = Inbox(given.asks)
    while not inbox.closed:
        select.select([inbox.descriptor], [], [])
        for payload in inbox.read():
            ask = Ask.decoded(payload)
            drawn = policy.sample(ask.observations[None], noise_names=[ask.noise], candidates=1)
            answer = Answer(
                ask.invocation, policy.checkpoint_hash, policy.sampler_config_hash, policy.method,
                drawn.actions[0, 0],
            )  # fmt: skip
            if not _send(given.answers, frame(answer.encoded())):
                return 0
    return 0


def _send(descriptor: int, data: bytes) -> bool:
    """Whether somebody reads; waits as long as the pipe is full."""
    try:
        while data:
            data = data[os.write(descriptor, data) :]
    except BrokenPipeError:
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
