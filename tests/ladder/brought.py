"""A policy of somebody else for a ladder that has run: its own flow, in a process of its own."""

import json
import shutil
import sys
from pathlib import Path

import yaml

from benchmarks.ladder_truth.bringing import ACTION, AS_TRAINED, CHANNELS
from genpolicy.integrity.hashing import sha256_file

NAME = "brought_flow"


def bring_flow(workspace: Path) -> Path:
    """Files and entry of the checkpoint that the ladder trained; returns the entry."""
    own = workspace / "own"
    shutil.copytree(workspace / "artifacts/train_generators/flow/seed_0", own / "flow")
    identity = json.loads((workspace / "artifacts/reload/identity.json").read_text())["flow"]
    horizons = yaml.safe_load((workspace / "params.yaml").read_text())["horizons"]
    files = ("flow/model.safetensors", "flow/config.json")
    serve = [sys.executable, "-m", "genpolicy", "serve-policy", "flow", "--port", "{port}"]
    card = identity["card"]
    entry = {
        "name": NAME,
        "kind": "server",
        "author": "author@example.org",
        "command": serve,
        "files": {name: sha256_file(own / name) for name in files},
        "horizons": horizons,
        "observation": {"observation": {"channels": CHANNELS, "history": 2, "dtype": "float64"}},
        "action": ACTION,
        "declared": {
            **{name: card[name] for name in AS_TRAINED},
            "training_seed": identity["seed"][0],
            "evaluations": int(card["evaluations"]),
        },
    }
    path = own / "flow.yaml"
    path.write_text(yaml.safe_dump(entry, sort_keys=False))
    return path
