"""A policy of somebody else for a ladder that has run: its own flow, in a process of its own."""

import sys
from pathlib import Path

from benchmarks.ladder_truth.bringing import TWIN, as_the_twin, bring_weights, enter
from genpolicy.integrity.hashing import sha256_file

NAME = "brought_flow"


def bring_flow(workspace: Path) -> None:
    """Files, entry and lines of `params.yaml` of the checkpoint that the ladder trained."""
    own = bring_weights(workspace)
    files = (f"{TWIN}/model.safetensors", f"{TWIN}/config.json")
    serve = [sys.executable, "-m", "genpolicy", "serve-policy", TWIN, "--port", "{port}"]
    entry = {
        **as_the_twin(workspace, NAME),
        "kind": "server",
        "command": serve,
        "files": {name: sha256_file(own / name) for name in files},
    }
    enter(workspace, entry, "trained by its maker")
