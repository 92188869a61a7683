"""Checkpoints: a folder with `model.safetensors` and `config.json`, hashed before they are parsed.

Nothing here can run code from a file: safetensors holds numbers, the config is strict JSON, a
method is looked up by name. `sha256` of a checkpoint covers weights and config together.
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NoReturn

import torch
from pydantic import Field, ValidationError
from safetensors.torch import load as parse_tensors
from safetensors.torch import save as serialise_tensors

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings
from genpolicy.errors import BadInputError, ConfigError, IntegrityError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json, parse_json
from genpolicy.integrity.hashing import read_verified, sha256_bytes, sha256_bytes_of
from genpolicy.policies.methods import check_sampler, method_named
from genpolicy.policies.networks import Dimensions, PolicyNetwork
from genpolicy.policies.normalisation import Normalisation
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig, TrainingConfig

WEIGHTS_FILE = "model.safetensors"
CONFIG_FILE = "config.json"
FORMAT_VERSION: Literal[1] = 1
METADATA_KEY = "genpolicy"
MAXIMUM_WEIGHTS_BYTES = 1 << 30
MAXIMUM_HEADER_BYTES = 1 << 20
MAXIMUM_CONFIG_BYTES = 1 << 20
LENGTH_BYTES = 8
DIGEST = r"^[0-9a-f]{64}$"


class MinMaxRecord(Settings):
    """`MinMax` in a config file."""

    minimum: tuple[float, ...]
    maximum: tuple[float, ...]


class NormalisationRecord(Settings):
    """`Normalisation` in a config file."""

    observation: MinMaxRecord
    action: MinMaxRecord


class Provenance(Settings):
    """What a checkpoint rests on.

    Attributes:
        dataset_manifest_sha256: Manifest of the dataset that it was trained on.
        action_contract_sha256: Definition of the action.
        observation_contract_sha256: Definition of the observation.
        episodes_sha256: Identifiers of the episodes, where it was not trained on all of the
            training split; None where it was.
    """

    dataset_manifest_sha256: str = Field(pattern=DIGEST)
    action_contract_sha256: str = Field(pattern=DIGEST)
    observation_contract_sha256: str = Field(pattern=DIGEST)
    episodes_sha256: str | None = Field(default=None, pattern=DIGEST)


class Distilled(Settings):
    """What stands behind a distilled checkpoint, and what both trainings took.

    Attributes:
        teacher: Registered method of the teacher.
        teacher_sha256: The teacher's checkpoint.
        updates: Optimiser updates of teacher and student.
        evaluations: Network evaluations of single windows in these updates.
        gradients: Those among them that were differentiated; the others were of a frozen network.
    """

    teacher: str
    teacher_sha256: str = Field(pattern=DIGEST)
    updates: int = Field(ge=1)
    evaluations: int = Field(ge=1)
    gradients: int = Field(ge=1)


class CheckpointConfig(Settings):
    """Everything about a checkpoint except its weights; the content of `config.json`.

    Attributes:
        format_version: Version of this schema.
        method: Registered name.
        horizons: Horizons of the method (K = H_e = 1 for `bc`).
        dimensions: Sizes of the network's input and output.
        normalisation: Statistics of the training split.
        network: Sizes of encoder, trunk and head.
        head: Head settings.
        training: Optimisation settings.
        training_seed: Root seed of the training.
        sampler: Sampler that the checkpoint is used with unless another one is asked for.
        provenance: Dataset and contracts.
        parameters: Parameters of encoder, trunk, head and total.
        training_only_parameters: Parameters that exist during training only.
        flops: Matrix-product operations for one row, per part.
        weights_sha256: Digest of `model.safetensors`.
        distilled: Its teacher and the cost of both; None, and not in the file, without a teacher.
    """

    format_version: Literal[1]
    method: str
    horizons: HorizonConfig
    dimensions: Dimensions
    normalisation: NormalisationRecord
    network: NetworkConfig
    head: HeadConfig
    training: TrainingConfig
    training_seed: int
    sampler: SamplerConfig
    provenance: Provenance
    parameters: dict[str, int]
    training_only_parameters: int
    flops: dict[str, int]
    weights_sha256: str = Field(pattern=DIGEST)
    distilled: Distilled | None = None


@dataclass(frozen=True)
class Checkpoint:
    """A verified checkpoint.

    Attributes:
        config: Its configuration.
        network: Its network with the stored weights, in evaluation mode, on the CPU.
        sha256: Digest of weights and config; the policy's identity.
    """

    config: CheckpointConfig
    network: PolicyNetwork
    sha256: str

    @property
    def normalisation(self) -> Normalisation:
        """Statistics of the training split."""
        return Normalisation.from_json(self.config.normalisation.model_dump())


def serialise_weights(network: PolicyNetwork, *, method: str) -> bytes:
    """The weights as safetensors; equal weights give equal bytes.

    One metadata key only: with several, the library writes them in random order.
    """
    tensors = {name: value.detach().cpu().contiguous() for name, value in _state(network).items()}
    description = canonical_json({"format_version": FORMAT_VERSION, "method": method}).decode()
    return serialise_tensors(tensors, metadata={METADATA_KEY: description})


def save_checkpoint(folder: Path, *, weights: bytes, config: CheckpointConfig) -> str:
    """Write both files into `folder` and return the checkpoint's SHA-256.

    Raises:
        BadInputError: The place cannot be written.
    """
    # Left out where there is none: a checkpoint's name must not change with what it is not.
    without = {"distilled"} if config.distilled is None else None
    text = canonical_json(config.model_dump(mode="json", exclude=without))
    write_bytes(folder / WEIGHTS_FILE, weights)
    write_bytes(folder / CONFIG_FILE, text)
    return _identity(weights, text)


def load_checkpoint(folder: Path, *, expected_sha256: str | None = None) -> Checkpoint:
    """Read and verify a checkpoint; nothing is parsed before its hash is known.

    Args:
        folder: Folder of the two files.
        expected_sha256: The identity that the checkpoint must have, where the caller knows one.

    Raises:
        IntegrityError: Missing or changed files, another identity, not safetensors, tensors
            that are extra, missing, of another shape or type, or not finite.
    """
    _check_file_size(folder / CONFIG_FILE, MAXIMUM_CONFIG_BYTES)
    _check_file_size(folder / WEIGHTS_FILE, MAXIMUM_WEIGHTS_BYTES)
    _, text = sha256_bytes_of(folder / CONFIG_FILE, keep=True)
    if expected_sha256 is not None:
        weights_digest, weights = sha256_bytes_of(folder / WEIGHTS_FILE, keep=True)
        _check_identity(folder, _identity_of(weights_digest, text), expected_sha256)
    config = _parse_config(text, where=folder / CONFIG_FILE)
    weights = read_verified(
        folder / WEIGHTS_FILE, sha256=config.weights_sha256, named_by=str(folder / CONFIG_FILE)
    )
    identity = _identity(weights, text)
    if expected_sha256 is not None:
        _check_identity(folder, identity, expected_sha256)
    network = _build(config, where=folder / CONFIG_FILE)
    _load_weights(network, weights, where=folder / WEIGHTS_FILE)
    return Checkpoint(config=config, network=network.eval(), sha256=identity)


def _identity(weights: bytes, config: bytes) -> str:
    return _identity_of(sha256_bytes(weights), config)


def _identity_of(weights_sha256: str, config: bytes) -> str:
    return sha256_bytes(f"{weights_sha256}\n{sha256_bytes(config)}\n".encode())


def _check_identity(folder: Path, found: str, expected: str) -> None:
    if found != expected:
        _refuse(folder, f"a checkpoint with sha256 {found[:16]}…", f"{expected[:16]}…")


def _check_file_size(path: Path, limit_bytes: int) -> None:
    try:
        size = path.lstat().st_size
    except OSError as error:
        _refuse(path, f"not readable ({error.strerror})", "a regular file")
    if not size <= limit_bytes:
        _refuse(path, f"{size} bytes", f"at most {limit_bytes} bytes")


def _parse_config(text: bytes, *, where: Path) -> CheckpointConfig:
    try:
        parse_json(text, where=str(where))
        return CheckpointConfig.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        _refuse(where, f"wrong at {place} ({first['msg']})", "a checkpoint configuration")
    except BadInputError as error:
        _refuse(where, error.found, error.expected)


def _build(config: CheckpointConfig, *, where: Path) -> PolicyNetwork:
    sizes, horizons = config.dimensions, config.horizons
    consistent = (
        sizes.observation_horizon == horizons.observation_horizon
        and sizes.prediction_horizon == horizons.prediction_horizon
        and len(config.normalisation.observation.minimum) == sizes.observation_dim
        and len(config.normalisation.action.minimum) == sizes.action_dim
        and all(column < sizes.observation_dim for column in sizes.phase_columns)
    )
    if not consistent:
        _refuse(where, "a config whose dimensions contradict each other", "one set of dimensions")
    try:
        method = method_named(config.method)
        check_sampler(method, config.sampler, config.head)
        Normalisation.from_json(config.normalisation.model_dump())
        with torch.device("meta"):
            network = method.build(sizes, config.network, config.head)
    except (ConfigError, BadInputError) as error:
        _refuse(where, f"inconsistent ({error.where}: {error.found})", error.expected)
    teacher = config.distilled.teacher if config.distilled else None
    if teacher != method.teacher:
        _refuse(where, f"{method.name} with the teacher {teacher}", f"the teacher {method.teacher}")
    return network


def _load_weights(network: PolicyNetwork, weights: bytes, *, where: Path) -> None:
    expected = {name: list(value.shape) for name, value in _state(network).items()}
    _check_header(weights, expected, where=where)
    try:
        tensors = parse_tensors(weights)
    except Exception as error:  # the parser raises its own type, or ValueError, by version
        _refuse(where, f"not safetensors ({type(error).__name__})", "a safetensors file")
    for name, tensor in tensors.items():
        if not bool(torch.isfinite(tensor).all()):
            _refuse(where, f"holding a weight that is not finite, in {name}", "finite weights")
    # Taken over, not copied into empty ones: torch makes empty tensors like meta ones by code that
    # imports a computer algebra system, half of what loading a policy took.
    own = {name: tensor.clone() for name, tensor in tensors.items()}
    network.load_state_dict(own, strict=True, assign=True)


def _check_header(weights: bytes, expected: dict[str, list[int]], *, where: Path) -> None:
    """Names, shapes, types and the exact layout, before the library sees the bytes."""
    length = int.from_bytes(weights[:LENGTH_BYTES], "little")
    if len(weights) < LENGTH_BYTES or not length <= min(
        MAXIMUM_HEADER_BYTES, len(weights) - LENGTH_BYTES
    ):
        _refuse(where, "not safetensors (header length)", "a safetensors file")
    raw = weights[LENGTH_BYTES : LENGTH_BYTES + length]
    try:
        header = parse_json(raw, where=str(where))
    except BadInputError as error:
        _refuse(where, error.found, "a safetensors header")
    if not isinstance(header, dict):
        _refuse(where, "a header that is no object", "a safetensors header")
    header.pop("__metadata__", None)
    if set(header) != set(expected):
        odd = sorted(set(header) ^ set(expected))[0]
        kind = "missing" if odd in expected else "extra"
        _refuse(where, f"a file with the tensor {odd[:80]!r} {kind}", "the tensors of its config")
    spans: list[list[int]] = []
    for name, shape in expected.items():
        entry = header[name]
        size = 4 * math.prod(shape)
        offsets = entry.get("data_offsets") if isinstance(entry, dict) else None
        if (
            not isinstance(offsets, list)
            or [type(value) for value in offsets] != [int, int]
            or offsets[1] - offsets[0] != size
            or entry.get("dtype") != "F32"
            or entry.get("shape") != shape
        ):
            found = json.dumps(entry)[:120]
            _refuse(where, f"a file with tensor {name} as {found}", f"F32 of shape {shape}")
        spans.append(offsets)
    ends = [0, *(end for _, end in sorted(spans))]
    if [start for start, _ in sorted(spans)] != ends[:-1] or (
        ends[-1] != len(weights) - LENGTH_BYTES - length
    ):
        _refuse(where, "a file with gaps or overlaps", "tensors laid end to end")


def _state(network: PolicyNetwork) -> dict[str, torch.Tensor]:
    state: dict[str, torch.Tensor] = network.state_dict()
    return state


def _refuse(where: Path, found: str, expected: str) -> NoReturn:
    raise IntegrityError(
        where=str(where),
        found=found,
        expected=expected,
        action="Do not use this checkpoint; train it again (`dvc repro`) or restore it.",
    )
