"""`genpolicy export torch` and `export onnx`: a checkpoint for others to run."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal

import yaml

from genpolicy.candidates.exports.onnx_export import onnx_bytes
from genpolicy.candidates.exports.torch_export import torch_bytes
from genpolicy.candidates.exports.unrolled import CONDITION, NOISE, Exported, apart, whole
from genpolicy.cli.beforehand import check_file
from genpolicy.errors import ConfigError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.policies.policy import load_policy

WRITERS: dict[str, Callable[[Exported], bytes]] = {"torch": torch_bytes, "onnx": onnx_bytes}


def run_export_program(
    checkpoint: Path,
    out: Path,
    *,
    kind: Literal["torch", "onnx"],
    encoder: Path | None,
    force: bool,
) -> int:
    """Write a checkpoint as a program, and print what an entry says of it.

    Raises:
        ConfigError: A sampler that cannot be written out, or a library that is not there.
        BadInputError: The checkpoint is missing or malformed, or a file is there already.
    """
    if encoder is not None and encoder.resolve() == out.resolve():
        raise ConfigError(
            where="--encoder",
            found=f"{encoder}, as --out",
            expected="a file of its own",
            action="Name another file; nothing was written.",
        )
    for file in (out, *([encoder] if encoder else [])):
        check_file(file, force=force)
    policy, write = load_policy(checkpoint), WRITERS[kind]
    files: dict[Path, bytes] = {}
    if encoder is None:
        program = whole(policy)
    else:
        first, program = apart(policy)
        files[encoder] = write(first)
    files[out] = write(program)
    for file, data in files.items():
        write_bytes(file, data)
    said: dict[str, object] = {"kind": kind, "program": out.name}
    if encoder is not None:
        said["encoder"] = {"program": encoder.name, "gives": CONDITION}
    said["files"] = {file.name: sha256_bytes(data) for file, data in files.items()}
    said["stochastic"] = NOISE in program.inputs
    if NOISE in program.inputs:
        said["noise"] = program.noise(policy.checkpoint_hash)
    said["counted_weight"] = program.counted_weight
    print("# In the entry, beside name, author, horizons, observation and action:")
    print(yaml.safe_dump(said, sort_keys=False), end="")
    return 0
