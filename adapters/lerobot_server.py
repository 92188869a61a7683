"""A LeRobot `pretrained_model` folder behind the wire that genpolicy asks candidates over.

Runs in LeRobot's own environment (`make lerobot`), never in genpolicy's, and imports nothing of
genpolicy. LeRobot's own code loads, reads and writes: its policy, its pre- and post-processor.
Tried with ACT and Diffusion of LeRobot 0.6.1.

    build/lerobot/bin/python adapters/lerobot_server.py PRETRAINED_MODEL --port 8000

See docs/candidates.md for the entry that asks it.
"""

import argparse
import hashlib
import os
import threading
import time
from pathlib import Path

# What is judged lies in the folder, by its hash: nothing is fetched beside it.
os.environ["HF_HUB_OFFLINE"] = "1"

import msgpack
import numpy as np
import torch
from lerobot.configs.policies import PreTrainedConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from websockets.sync.server import serve

MAXIMUM_MESSAGE_BYTES = 16 << 20
MOST_CANDIDATES = 64
NETWORKS = {"act": "model.forward", "diffusion": "diffusion.unet.forward"}
"""What runs once per evaluation, by type of policy; of other types nobody counts."""
ENCODERS = {"act": "model.encoder.forward", "diffusion": "diffusion._prepare_global_conditioning"}
"""What makes a condition of the observation, by type of policy; its time is the term `encode`."""


class Watched:
    """A function of the policy that is counted and timed where it is called."""

    def __init__(self, policy: torch.nn.Module, path: str) -> None:
        self.calls, self.seconds = 0, 0.0
        owner, _, name = path.rpartition(".")
        for part in owner.split("."):
            policy = getattr(policy, part)
        inner = getattr(policy, name)

        def watched(*args: object, **kwargs: object) -> object:
            begun = time.perf_counter()
            try:
                return inner(*args, **kwargs)
            finally:
                self.calls += 1
                self.seconds += time.perf_counter() - begun

        setattr(policy, name, watched)


class Served:
    """A checkpoint with its processors."""

    def __init__(self, folder: Path, device: str) -> None:
        self.one_at_a_time = threading.Lock()
        config = PreTrainedConfig.from_pretrained(folder)
        config.device = device
        self.checkpoint = digest(folder)
        self.policy = get_policy_class(config.type).from_pretrained(folder, config=config).eval()
        self.before, self.after = make_pre_post_processors(
            config,
            pretrained_path=str(folder),
            preprocessor_overrides={"device_processor": {"device": device}},
        )
        self.history = getattr(config, "n_obs_steps", 1)
        self.inputs = [name for name in config.input_features if not name.startswith("action")]
        self.asked = 0
        kind = config.type
        self.network = Watched(self.policy, NETWORKS[kind]) if kind in NETWORKS else None
        self.encoder = Watched(self.policy, ENCODERS[kind]) if kind in ENCODERS else None

    @property
    def metadata(self) -> dict:
        return {
            "policy": self.policy.name,
            "inputs": self.inputs,
            "n_obs_steps": self.history,
            "genpolicy": {
                "version": 1, "checkpoint": self.checkpoint,
                "seeded": True, "candidates": MOST_CANDIDATES,
                "counts_evaluations": self.network is not None,
                "spans": ["preprocess", *(["encode"] if self.encoder else []), "sample"],
            },
        }  # fmt: skip

    def answer(self, message: dict) -> dict:
        """One at a time: torch's generator and the counters are of the whole process."""
        with self.one_at_a_time:
            return self._answered(message)

    def _answered(self, message: dict) -> dict:
        said = message.get("genpolicy")
        noise = said["noise"] if said else ["unnamed", self.asked]
        self.asked += 1
        begun = time.perf_counter()
        batch = {name: torch.from_numpy(np.array(message[name], dtype=np.float32))
                 for name in self.inputs}  # fmt: skip
        batch = self.before(batch)
        # A history of one is a vector; of more, the policy wants (1, steps, size).
        if self.history > 1:
            batch = {
                name: value.reshape(1, self.history, -1) if name in self.inputs else value
                for name, value in batch.items()
            }
        prepared = time.perf_counter()
        wanted = said["candidates"] if said else 1
        for watched in (self.network, self.encoder):
            if watched:
                watched.calls, watched.seconds = 0, 0.0
        drawn = [self.draw(batch, noise, number) for number in range(wanted)]
        sampled = time.perf_counter()
        if not said:
            return {"actions": drawn[0]}
        encoding = self.encoder.seconds if self.encoder else 0.0
        spans = {"preprocess": prepared - begun, "sample": sampled - prepared - encoding}
        if self.encoder:
            spans["encode"] = encoding
        told = {"invocation": said["invocation"], "checkpoint": self.checkpoint, "spans_s": spans}
        if self.network:
            told["nfe"] = self.network.calls // wanted
        return {"actions": np.stack(drawn), "genpolicy": told}

    def draw(self, batch: dict, noise: list, number: int) -> np.ndarray:
        """One chunk (K, D), from torch's own generator, seeded by the name of the noise."""
        named = hashlib.sha256(repr([self.checkpoint, *noise, number]).encode()).digest()
        torch.manual_seed(int.from_bytes(named[:8], "little") >> 1)
        self.policy.reset()
        with torch.inference_mode():
            chunk = self.after(self.policy.predict_action_chunk(batch))
        return chunk[0].cpu().numpy().astype(np.float64)


def digest(folder: Path) -> str:
    """SHA-256 over names and bytes of what makes the policy."""
    found = hashlib.sha256()
    for path in sorted(folder.iterdir()):
        if path.suffix in (".json", ".safetensors") and path.name != "train_config.json":
            found.update(f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return found.hexdigest()


def packed(value: object) -> dict:
    if isinstance(value, np.ndarray):
        return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": value.dtype.str,
                b"shape": value.shape}  # fmt: skip
    raise TypeError(type(value).__name__)


def unpacked(found: dict) -> object:
    if b"__ndarray__" in found:
        return np.frombuffer(found[b"data"], np.dtype(found[b"dtype"])).reshape(found[b"shape"])
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--device", default="cpu")
    given = parser.parse_args()
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    served = Served(given.folder, given.device)

    def talk(line) -> None:
        line.send(msgpack.packb(served.metadata))
        for data in line:
            message = msgpack.unpackb(data, object_hook=unpacked)
            line.send(msgpack.packb(served.answer(message), default=packed))

    with serve(talk, "127.0.0.1", given.port, compression=None, ping_interval=None,
               max_size=MAXIMUM_MESSAGE_BYTES) as server:  # fmt: skip
        print(f"Serving {served.policy.name} at ws://127.0.0.1:{given.port}", flush=True)
        server.serve_forever()


if __name__ == "__main__":
    main()
