"""One checkpoint of ours as a candidate of each kind: what its entry says of how it is hosted."""

import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, Literal

import yaml

from genpolicy.candidates.hosts.kinds import CHECKPOINT_FILES
from genpolicy.cli.programs import run_export_program
from genpolicy.integrity.hashing import sha256_file

KINDS = ("trained", "torch", "onnx", "server")
"""Kinds that can host weights of ours."""


def of_each_kind(folder: Path, checkpoint: str) -> dict[str, dict[str, Any]]:
    """Fields by kind, of a checkpoint in a folder in which the exports are written.

    Args:
        folder: Of the entries.
        checkpoint: Folder of the checkpoint, from there.
    """
    weights = {
        f"{checkpoint}/{name}": sha256_file(folder / checkpoint / name) for name in CHECKPOINT_FILES
    }
    serve = [sys.executable, "-P", "-m", "genpolicy", "serve-policy", checkpoint]
    return {
        "trained": {"checkpoint": checkpoint, "files": weights},
        "torch": _exported(folder, checkpoint, "torch", ".pt2"),
        "onnx": _exported(folder, checkpoint, "onnx", ".onnx"),
        "server": {"command": [*serve, "--port", "{port}"], "files": weights},
    }


def _exported(
    folder: Path, checkpoint: str, kind: Literal["torch", "onnx"], ending: str
) -> dict[str, Any]:
    """What the command prints for an entry."""
    with redirect_stdout(StringIO()) as said:
        run_export_program(
            folder / checkpoint, folder / f"sampler{ending}", kind=kind,
            encoder=folder / f"encoder{ending}", force=True,
        )  # fmt: skip
    fields: dict[str, Any] = yaml.safe_load(said.getvalue())
    return fields
