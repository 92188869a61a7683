"""A LeRobot `pretrained_model` folder as a candidate of a ladder: its files, and its entry."""

import math
import shutil
from pathlib import Path
from typing import Any

from safetensors import safe_open

from benchmarks.ladder_truth.bringing import OWN, as_the_twin, enter
from genpolicy.candidates.hosts.kinds import TRAINING_RECORD
from genpolicy.errors import BadInputError
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.hashing import sha256_file

STATE = ["tcp_position_m", "tcp_rotation", "gripper_opening_m"]
ENVIRONMENT = ["wrench_n", "hole_pose", "post_position_m", "phase"]
REASON = "trained by LeRobot's own script on the exported split"
TRAINS_ONLY = "model.vae_encoder"
"""Begins the names of ACT's weights that no inference reads."""
OF_THE_TWIN = ("dataset", "split", "cpu_capability")
ON_THE_CPU = {"precision": "float32", "device": "cpu", "threads": 1, "batch_rows": 1}


def bring(workspace: Path, name: str, folder: Path, *, interpreter: Path, data: Path) -> None:
    """Copy a folder into a ladder, write its entry, and name it.

    Args:
        workspace: A ladder that has run.
        name: Of the candidate.
        folder: LeRobot's `pretrained_model`.
        interpreter: A Python that has LeRobot.
        data: The export that it was trained on.

    Raises:
        BadInputError: It was trained on the export of other data, or is no ACT or Diffusion policy
            of as many actions as the ladder's chunks have.
    """
    entry = entry_of(workspace, name, folder, data=data)
    own = workspace / OWN / name
    shutil.rmtree(own, ignore_errors=True)
    own.mkdir(parents=True)
    for path in sorted(folder.iterdir()):
        if path.suffix in (".json", ".safetensors") and path.name != TRAINING_RECORD:
            shutil.copyfile(path, own / path.name)
    entry["interpreter"] = str(interpreter.absolute())
    entry["files"] = {f"{name}/{path.name}": sha256_file(path) for path in sorted(own.iterdir())}
    enter(workspace, entry, REASON)


def entry_of(workspace: Path, name: str, folder: Path, *, data: Path) -> dict[str, Any]:
    """What is said of it; of files and interpreter nothing yet."""
    twin = as_the_twin(workspace, name)
    trained_on = read_json(data / "meta" / "genpolicy.json")["dataset_manifest_sha256"]
    if trained_on != twin["declared"]["dataset"]:
        raise BadInputError(
            where=str(data),
            found=f"an export of the dataset {trained_on}",
            expected=f"{twin['declared']['dataset']}, that of {workspace}",
            action="Export it (`genpolicy export lerobot`) and train LeRobot on it.",
        )
    config = read_json(folder / "config.json")
    declared = {"act": _act, "diffusion": _diffusion}.get(config["type"], _neither)(config)
    actions, wanted = declared.pop("actions"), twin["horizons"]["prediction_horizon"]
    if actions != wanted:
        raise BadInputError(
            where=str(folder / "config.json"),
            found=f"a policy of {actions} actions",
            expected=f"one of {wanted}, as the chunks of the ladder",
            action="Train it with that `chunk_size` (ACT) or `n_action_steps` (Diffusion).",
        )
    record = read_json(folder / TRAINING_RECORD)
    history = {"history": config["n_obs_steps"]}
    return {
        **twin,
        "kind": "lerobot",
        "pretrained_model": name,
        "observation": {
            "observation.state": {"channels": STATE, **history},
            "observation.environment_state": {"channels": ENVIRONMENT, **history},
        },
        "stochastic": config["type"] == "diffusion",
        "declared": {
            **{key: twin["declared"][key] for key in OF_THE_TWIN},
            **ON_THE_CPU,
            **declared,
            "training_seed": record["seed"],
            "parameters": parameters(folder / "model.safetensors"),
        },
        "start_timeout_s": 300.0,
        "timeout_s": 20.0,
    }


def parameters(file: Path) -> int:
    """Numbers of the network that runs."""
    with safe_open(file, "numpy") as tensors:
        names = [name for name in tensors.keys() if not name.startswith(TRAINS_ONLY)]  # noqa: SIM118
        return sum(math.prod(tensors.get_slice(name).get_shape()) for name in names)


def _act(config: dict[str, Any]) -> dict[str, Any]:
    return {
        "actions": config["chunk_size"],
        "architecture": f"LeRobot's ACT of width {config['dim_model']}, "
        f"{config['n_encoder_layers']} encoder and {config['n_decoder_layers']} decoder layers",
        "path": "none: the chunk at the latent's mean",
        "sampler": "direct",
        "sampler_steps": 1,
        "evaluations": 1,
    }


def _diffusion(config: dict[str, Any]) -> dict[str, Any]:
    steps = config["num_inference_steps"] or config["num_train_timesteps"]
    sampler = config["noise_scheduler_type"].lower()
    return {
        "actions": config["n_action_steps"],
        "architecture": f"LeRobot's 1-D U-Net of widths {config['down_dims']}",
        "path": f"{config['beta_schedule']}, {config['num_train_timesteps']} levels, network "
        f"predicts {config['prediction_type']}",
        "sampler": sampler,
        "sampler_steps": steps,
        "evaluations": steps,
        **({"eta": 0.0} if sampler == "ddim" else {}),
    }


def _neither(config: dict[str, Any]) -> dict[str, Any]:
    raise BadInputError(
        where="config.json of a pretrained_model",
        found=f"the type {config['type']}",
        expected="act or diffusion",
        action="Write the entry by hand: docs/candidates.md, A policy of LeRobot.",
    )
