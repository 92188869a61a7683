"""Record the exchange that `test_openpi.py` replays, with openpi's own client package.

Needs the package `openpi-client` of Physical Intelligence (Apache-2.0), unpacked anywhere:

    pip download --no-deps --dest SCRATCH openpi-client==0.1.2
    python -m zipfile -e SCRATCH/openpi_client-0.1.2-py3-none-any.whl SCRATCH
    PYTHONPATH=SCRATCH python -m tests.candidates.wire.record_openpi

Kept are bytes: what its client sends to a server, what its packing makes of a server's metadata and
answer, and what its client reads in an answer of ours. The package has no server; openpi's packs by
the same module.
"""

import importlib
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
from websockets.sync.server import ServerConnection, serve

from genpolicy.candidates.wire.packing import pack

RECORDED = Path(__file__).parent / "recorded" / "openpi_client.msgpack"
PACKAGE = "openpi_client"
"""Needed to record, and by nothing else here: no environment of ours has it."""
METADATA: dict[str, Any] = {"reset_pose": [0.0, -0.5], "action_horizon": 16}
PROMPT = "insert the peg"
ROWS = 16


def observation() -> dict[str, Any]:
    """What is asked: two arrays of other types, and a text."""
    return {
        "observation": np.arange(48.0).reshape(2, 24) / 7.0,
        "observation/state": (np.arange(10.0) / 3.0).astype(np.float32),
        "prompt": PROMPT,
    }


def answer() -> dict[str, Any]:
    """What is answered: actions in single precision, and what openpi's server says of its time."""
    actions = np.zeros((ROWS, 10), dtype=np.float32)
    actions[:, :3] = np.linspace(0.1, 0.3, 3 * ROWS).reshape(ROWS, 3)
    actions[:, [3, 7]] = 1.0
    return {"actions": actions, "server_timing": {"infer_ms": np.float32(12.5)}}


@contextmanager
def raw_server(talk: Callable[[ServerConnection], None]) -> Iterator[str]:
    """A server on this machine that does with its line whatever a function wants; its address."""
    server = serve(talk, "127.0.0.1", 0, compression=None, max_size=None)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
    server.shutdown()
    thread.join(5)


def main() -> None:
    """Ask by openpi's client, once in its own packing and once a server that packs as ours."""
    packing = importlib.import_module(f"{PACKAGE}.msgpack_numpy")
    client = importlib.import_module(f"{PACKAGE}.websocket_client_policy")
    kept: dict[str, Any] = {"version": version("openpi-client")}
    for name, packed in (("theirs", packing.packb), ("ours", pack)):
        said, answered = packed(METADATA), packed(answer())
        asked: list[bytes] = []

        def talk(
            line: ServerConnection, said: bytes = said, answered: bytes = answered,
            asked: list[bytes] = asked,
        ) -> None:  # fmt: skip
            line.send(said)
            for data in line:
                assert isinstance(data, bytes)
                asked.append(data)
                line.send(answered)

        with raw_server(talk) as address:
            policy = client.WebsocketClientPolicy(address)
            read = policy.infer(observation())
            kept[name] = {
                "metadata": said, "asked": asked[0], "answered": answered,
                "read_metadata": policy.get_server_metadata() == METADATA,
                "read_actions": read["actions"].tobytes(), "read_dtype": read["actions"].dtype.str,
            }  # fmt: skip
            policy._ws.close()
    RECORDED.write_bytes(msgpack.packb(kept))
    print(f"{RECORDED}: {kept['version']}, {len(RECORDED.read_bytes())} bytes")


if __name__ == "__main__":
    main()
