"""How a planted candidate gets into a workspace: the ladder's own flow behind a server script."""

import datetime
import shutil
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from benchmarks.ladder_truth.workspace import edit_params
from gates.exceptions import utc_today
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.hashing import sha256_file

SERVER = Path(__file__).with_name("planted_server.py")
OWN = "own"
A_WHILE = datetime.timedelta(days=30)
"""An exception holds for so long from the day on which it is planted."""
FLOW = "artifacts/train_generators/flow/seed_0"
TWIN = "flow"
"""Whose weights are served: what a ladder says of it, it says of an honest copy."""
TOGETHER = "brought_policies"
"""All that are brought run in one copy, wrong or honest: what stops one of them stops no other."""
CHANNELS = [
    "tcp_position_m", "tcp_rotation", "gripper_opening_m", "wrench_n", "hole_pose",
    "post_position_m", "phase",
]  # fmt: skip
AS_TRAINED = (
    "dataset", "split", "architecture", "parameters", "path", "sampler", "sampler_steps",
    "precision", "device", "threads", "cpu_capability", "batch_rows",
)  # fmt: skip
ACTION: Mapping[str, Any] = {
    "frame": "robot_base",
    "motion": "absolute",
    "position": {"columns": [0, 1, 2], "unit": "m"},
    "rotation": {"columns": [3, 4, 5, 6, 7, 8], "form": "rotation_6d"},
    "gripper": {"column": 9, "open": 1.0, "open_m": 1.0},
}
IN_MM: Mapping[str, Any] = {
    "position": {"columns": [0, 1, 2], "unit": "mm"},
    "gripper": {"column": 9, "open": 1000.0, "open_m": 1.0},
}
AS_QUATERNION: Mapping[str, Any] = {
    "rotation": {"columns": [3, 4, 5, 6], "form": "quaternion_xyzw"},
    "gripper": {"column": 7, "open": 1.0, "open_m": 1.0},
}
REASON = "the weights of the twin, served by a script"


@dataclass(frozen=True)
class Brings:
    """Brings one candidate behind the server script; a plant.

    Attributes:
        name: Of the candidate.
        wrong: What the script does (`planted_server.WRONGS`).
        action: Of the entry, what differs from the checkpoint's own columns.
    """

    name: str
    wrong: str
    action: Mapping[str, Any] = field(default_factory=dict)

    def __call__(self, workspace: Path) -> None:
        """Files, entry, and the lines of `params.yaml`."""
        own = bring_weights(workspace)
        shutil.copyfile(SERVER, own / SERVER.name)
        files = (f"{TWIN}/model.safetensors", f"{TWIN}/config.json", SERVER.name)
        entry = {
            **as_the_twin(workspace, self.name),
            "kind": "server",
            "command": [
                sys.executable, SERVER.name, TWIN, self.wrong, "--port", "{port}",
                "--name", self.name,
            ],
            "files": {name: sha256_file(own / name) for name in files},
        }  # fmt: skip
        entry["action"] |= self.action
        enter(workspace, entry, REASON)


def bring_weights(workspace: Path) -> Path:
    """The twin's checkpoint as somebody else's: the folder in which it lies as `flow`."""
    own = workspace / OWN
    if not (own / TWIN).exists():
        shutil.copytree(workspace / FLOW, own / TWIN)
    return own


def as_the_twin(workspace: Path, name: str) -> dict[str, Any]:
    """What an entry says of the twin's weights, whatever hosts them."""
    identity = read_json(workspace / "artifacts/reload/identity.json")[TWIN]
    card = identity["card"]
    return {
        "name": name,
        "author": "author@example.org",
        "horizons": yaml.safe_load((workspace / "params.yaml").read_text())["horizons"],
        "observation": {"observation": {"channels": CHANNELS, "history": 2, "dtype": "float64"}},
        "action": dict(ACTION),
        "declared": {
            **{name: card[name] for name in AS_TRAINED},
            "training_seed": identity["seed"][0],
            "evaluations": int(card["evaluations"]),
        },
    }


def enter(workspace: Path, entry: Mapping[str, Any], reason: str) -> None:
    """Write an entry, and name it in `params.yaml` with the exception that Gate B wants."""
    name = entry["name"]
    path = workspace / OWN / f"{name}.yaml"
    path.write_text(yaml.safe_dump(dict(entry), sort_keys=False))

    def change(params: dict[str, Any]) -> None:
        params["candidates"][name] = path.relative_to(workspace).as_posix()
        params["gate_b"]["unmatched"][name] = {
            "owner": "model", "reason": reason, "expires": str(utc_today() + A_WHILE),
        }  # fmt: skip

    edit_params(workspace, change)
