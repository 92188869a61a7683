"""Record the exchange that `test_lerobot.py` replays, from `adapters/lerobot_server.py` itself.

Needs LeRobot's environment (`make lerobot`) and a policy that it trained on our export:

    python -m tests.candidates.wire.record_lerobot act PRETRAINED_MODEL build/lerobot/bin/python

The observations are those of the recording that is there: rows 0 and 40 of the held-out windows of
a default ladder.
"""

import re
import sys
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import yaml

from genpolicy.candidates.hosts.kinds import LeRobotEntry
from genpolicy.candidates.wire.entry import Entry, ServerEntry
from genpolicy.candidates.wire.launched import Launched
from genpolicy.candidates.wire.packing import pack, unpack
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.tasks.api import load_task

HERE = Path(__file__).parent
DOCS = HERE.parents[2] / "docs" / "candidates.md"
ADAPTER = HERE.parents[2] / "adapters" / "lerobot_server.py"
NAMES = (("recorded", 0), ("recorded", 40))
CHUNKS = 2
HISTORY = {"act": 1, "diffusion": 2}


def entry_of(kind: str, command: list[str]) -> ServerEntry:
    """The docs' entry, with as much history as this kind of policy is given."""
    [text] = re.findall(r"```yaml\n# lerobot\.yaml\n(.*?)```", DOCS.read_text(), re.DOTALL)
    said = yaml.safe_load(re.sub('"@[a-z]+@"', repr("0" * 64), text))
    documented = LeRobotEntry.model_validate(said)
    same = {name: getattr(documented, name) for name in Entry.model_fields if name != "kind"}
    found = ServerEntry(**same, kind="server", command=command)
    inputs = {
        name: given.model_copy(update={"history": HISTORY[kind]})
        for name, given in found.observation.items()
    }
    return found.model_copy(update={"observation": inputs})


def main(kind: str, folder: str, python: str) -> None:
    """Ask the same two moments; keep every byte that was asked, and what was answered."""
    before = msgpack.unpackb((HERE / "recorded" / "lerobot_act.msgpack").read_bytes())
    task, command = load_task("tabletop_insertion"), [python, str(ADAPTER), folder]
    entry = entry_of(kind, [*command, "--port", "{port}"])
    exchanges: list[dict[str, Any]] = []
    with Launched(entry, Path.cwd()) as server:
        policy = RemotePolicy(entry, server.address, task.observation)
        line = policy._connected()
        metadata, ask = pack(line.metadata), line.ask

        def kept(message: dict[str, Any], *, timeout_s: float) -> dict[str, Any]:
            answer = ask(message, timeout_s=timeout_s)
            exchanges.append({"asked": pack(message), "answered": pack(answer)})
            return answer

        line.ask = kept  # type: ignore[method-assign]
        for name, old in zip(NAMES, before["exchanges"], strict=True):
            seen = np.frombuffer(old["observations"]).reshape(2, task.observation.dim)
            found = policy.invoke(seen, noise=name, candidates=CHUNKS)
            exchanges[-1] |= {"observations": seen.tobytes(), "mapped": found.actions.tobytes()}
        policy.close()
    out = HERE / "recorded" / f"lerobot_{kind}.msgpack"
    out.write_bytes(msgpack.packb({"metadata": metadata, "exchanges": exchanges}))
    print(f"{out}: {len(exchanges)} questions, {unpack(metadata)}")


if __name__ == "__main__":
    main(*sys.argv[1:])
