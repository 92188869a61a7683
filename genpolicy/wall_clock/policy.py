"""The policy's process: `python -m genpolicy.wall_clock.policy POLICY SHA256 --asks FD …`.

POLICY is the folder of a checkpoint, or the file of an entry whose server listens at `--address`.
It answers what it is asked, the first of the candidates that an invocation draws, and is trusted
with nothing.
"""

import argparse
import os
import select
import sys
from collections.abc import Sequence
from pathlib import Path

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.hosts.translation import as_server
from genpolicy.candidates.judged import loaded_on
from genpolicy.candidates.wire.policy import WirePolicy, WireSamples
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.errors import GenpolicyError
from genpolicy.policies.protocol import Policy
from genpolicy.tasks.api import load_task
from genpolicy.wall_clock.channel import Inbox, frame, send_all
from genpolicy.wall_clock.messages import Answer, Ask


def main(arguments: Sequence[str] | None = None) -> int:
    """Answer until nobody asks any more. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="genpolicy.wall_clock.policy")
    parser.add_argument("policy", type=Path)
    parser.add_argument("sha256")
    parser.add_argument("--candidates", type=int, default=1, help="drawn in an invocation")
    parser.add_argument("--device", default="", help="that a checkpoint runs on")
    parser.add_argument("--address", default="", help="of the server of a policy that is brought")
    parser.add_argument("--task", default="", help="whose observation the server is given")
    for name in ("asks", "answers"):
        parser.add_argument(f"--{name}", type=int, required=True, help="file descriptor")
    parser.add_argument("--ready", type=int, help="file descriptor to say on that it has loaded")
    given = parser.parse_args(arguments)
    if not (given.address or given.device):
        parser.error("--device of a checkpoint, or --address of a server")
    try:
        policy = _policy(given)
    except GenpolicyError as error:
        # Whoever started it sees a process that is gone, as of any other death; a person reads why.
        print(f"{given.policy} answers nothing by the wall clock: {error}", file=sys.stderr)
        return error.exit_code
    if given.ready is not None:
        os.write(given.ready, b".")
        os.close(given.ready)
    inbox = Inbox(given.asks)
    while not inbox.closed:
        select.select([inbox.descriptor], [], [])
        for payload in inbox.read():
            answer = answer_of(policy, Ask.decoded(payload), candidates=given.candidates)
            if answer is not None and not send_all(given.answers, frame(answer.encoded())):
                return 0
    return 0


def answer_of(policy: Policy, ask: Ask, *, candidates: int) -> Answer | None:
    """The first of the candidates that a policy draws for what it is asked.

    None where its process failed: what is no answer misses its deadline, as in rollouts.

    Args:
        policy: Who answers.
        ask: The invocation.
        candidates: How many are drawn; their number is part of the latency.
    """
    drawn = policy.sample(ask.observations[None], noise_names=[ask.noise], candidates=candidates)
    if isinstance(drawn, WireSamples) and drawn.faults[0] is not None:
        return None
    return Answer(
        ask.invocation, policy.checkpoint_hash, policy.sampler_config_hash, policy.method,
        drawn.actions[0, 0],
    )  # fmt: skip


def _policy(given: argparse.Namespace) -> Policy:
    """Whoever answers here.

    Raises:
        GenpolicyError: Its server is not there any more, or what was to be loaded is another one.
    """
    if given.address:
        return _behind_the_wire(given.policy, given.sha256, given.address, given.task)
    return loaded_on(given.device, given.policy, sha256=given.sha256)


def _behind_the_wire(path: Path, sha256: str, address: str, task: str) -> WirePolicy:
    """A brought policy whose server runs, and is ended, elsewhere."""
    entry, cell = read_entry(path), load_task(task)
    brought = BroughtPolicy(entry.name, path, entry, sha256, seed=0)
    server = as_server(entry, path, cell.observation)
    return WirePolicy(
        brought, RemotePolicy(server, address, cell.observation, scene=cell.scene_path)
    )


if __name__ == "__main__":
    sys.exit(main())
