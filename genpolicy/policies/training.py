"""Training of one method: deterministic, averaged weights, a checkpoint folder at the end.

AdamW with warm-up and cosine decay and an exponential moving average of the weights, which is
what is evaluated and saved (defaults after Chi et al., arXiv 2303.04137). Every method with the
same seed sees the same batches in the same order. The stopping rule is a fixed number of updates.
"""

import copy
import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.errors import NonFiniteError
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.integrity.rows import rows_of_table
from genpolicy.integrity.tables import read_table
from genpolicy.policies.checkpoint import (
    FORMAT_VERSION,
    Checkpoint,
    CheckpointConfig,
    Distilled,
    NormalisationRecord,
    serialise_weights,
)
from genpolicy.policies.determinism import deterministic, initial_weights, regime
from genpolicy.policies.methods import Method, check_sampler, method_named
from genpolicy.policies.networks import (
    Dimensions,
    PolicyNetwork,
    flops_per_evaluation,
    parameter_counts,
)
from genpolicy.policies.objectives import Batch, Objective
from genpolicy.policies.settings import TrainingConfig
from genpolicy.policies.sources import distilled, take_over, teacher_of
from genpolicy.policies.training_files import TrainingFiles
from genpolicy.policies.training_request import TrainingRequest
from genpolicy.policies.validation import Validation, moments
from genpolicy.policies.validation_row import (
    EARLIER_FOLDER,
    VALIDATION_FILE,
    ValidationRow,
    three_quarters,
)
from genpolicy.policies.windows import Windows, as_batch
from genpolicy.progress import counting
from genpolicy.seeds import integer_seed, stream


def train(
    folder: Path,
    request: TrainingRequest,
    *,
    windows: Windows,
    validation: Windows | None = None,
    device: str = "cpu",
    weights_of: Path | None = None,
) -> str:
    """Train one method and write its checkpoint folder, whole or not at all.

    Args:
        folder: Folder to write: weights, config, records; of named episodes `validation.parquet`.
        request: What decides the result.
        windows: Training split.
        validation: Validation split, for the record only; it stops and selects nothing.
        device: `cpu` or a CUDA device.
        weights_of: Checkpoint with weights to take over untrained, or of the teacher to distil.

    Returns:
        SHA-256 of the checkpoint.

    Raises:
        ConfigError: Unknown method, a sampler that does not fit it, or no teacher to distil.
        IntegrityError: The checkpoint that it rests on is damaged, or was trained differently.
        ContractError: Windows that do not fit the horizons or the normalisation.
        NonFiniteError: The loss became NaN or infinite.
    """
    method = method_named(request.method)
    check_sampler(method, request.sampler, request.head)
    horizons = method.horizons(request.horizons)
    teacher = teacher_of(method, weights_of, request)
    taken = weights_of if teacher is None else None
    with deterministic(device):
        data = _batch_of(windows, horizons, request, device)
        followed = _follow(validation, horizons, request, device) if validation else None
        network, objective = _build(method, request, device, teacher=teacher)
        objective.prepare(network, data)
        averaged = copy.deepcopy(network)
        if taken is not None:
            records = [take_over(averaged, taken, request)]
        else:
            course = _optimise(
                network, averaged, objective,
                data=data, followed=followed, request=request, device=device, of=folder,
            )  # fmt: skip
            records = list(course)
        trained = _finished(averaged, followed, objective, data)
    summary = {
        "stopping_rule": _stopping_rule(taken),
        "updates": request.training.updates,
        "evaluated_weights": "exponential moving average",
        **_given("", windows),
        **_given("validation_", validation),
        "final": records[-1],
        "regime": regime(device),
    }
    files = TrainingFiles(records, summary, _validation_rows(followed, taken))
    _add_checkpoints(files, trained, request, objective, behind=distilled(teacher, request))
    return files.write(folder)


def _given(prefix: str, windows: Windows | None) -> dict[str, int | list[str]]:
    """How many windows there were, and of which episodes, as the windows themselves say."""
    names = None if windows is None else windows.episodes
    return {
        f"{prefix}windows": 0 if windows is None else len(windows.observations),
        f"{prefix}episodes": [] if names is None else sorted(set(names.tolist())),
    }


def _finished(
    averaged: PolicyNetwork, followed: Validation | None, objective: Objective, data: Batch
) -> dict[str, PolicyNetwork]:
    """The result, and the earlier network where one was kept, by their folder."""
    earlier = followed.earlier if followed else None
    trained = {".": averaged} | ({EARLIER_FOLDER: earlier} if earlier else {})
    for network in trained.values():
        objective.finish(network, data)
    return trained


def _add_checkpoints(
    files: TrainingFiles,
    trained: Mapping[str, PolicyNetwork],
    request: TrainingRequest,
    objective: Objective,
    *,
    behind: Distilled | None,
) -> None:
    for part, network in trained.items():
        weights = serialise_weights(network, method=request.method)
        config = _checkpoint_config(request, network, objective, weights=weights, behind=behind)
        files.add(part, weights, config)


def _validation_rows(followed: Validation | None, weights_of: Path | None) -> list[ValidationRow]:
    """Rows of `validation.parquet`; of taken over weights those of their own training."""
    if followed is None:
        return []
    if weights_of is None:
        return followed.rows
    path = weights_of / VALIDATION_FILE
    if not path.is_file():
        return []
    return rows_of_table(read_table(path), ValidationRow, where=str(path))


def _stopping_rule(weights_of: Path | None) -> str:
    return f"weights of {weights_of.parent.name}" if weights_of else "fixed number of updates"


def learning_rate(update: int, config: TrainingConfig) -> float:
    """Rate of an update: linear warm-up, then a cosine to zero at the last one."""
    warmup = config.warmup_updates
    if update < warmup:
        return config.learning_rate * (update + 1) / warmup
    progress = (update - warmup) / max(1, config.updates - warmup)
    return config.learning_rate * 0.5 * (1.0 + math.cos(math.pi * progress))


def averaging_decay(update: int, config: TrainingConfig) -> float:
    """Share of the old average kept after an update, counted from 0."""
    return float(min(config.ema_cap, 1.0 - (1.0 + update) ** -config.ema_power))


def _batch_of(
    windows: Windows, horizons: HorizonConfig, request: TrainingRequest, device: str
) -> Batch:
    return as_batch(
        windows.shortened(horizons),
        request.normalisation,
        mask_padding=request.training.mask_padding,
        device=device,
    )


def _follow(
    windows: Windows, horizons: HorizonConfig, request: TrainingRequest, device: str
) -> Validation:
    held_out = _batch_of(windows, horizons, request, device)
    keep = three_quarters(request.training.updates) if request.keep_earlier else None
    return Validation(held_out, windows.episodes, seed=request.seed, device=device, keep_after=keep)


def _dimensions(horizons: HorizonConfig, request: TrainingRequest) -> Dimensions:
    return Dimensions(
        observation_horizon=horizons.observation_horizon,
        observation_dim=request.normalisation.observation.dim,
        prediction_horizon=horizons.prediction_horizon,
        action_dim=request.normalisation.action.dim,
        phase_columns=request.phase_columns,
    )


def _checkpoint_config(
    request: TrainingRequest,
    network: PolicyNetwork,
    objective: Objective,
    *,
    weights: bytes,
    behind: Distilled | None,
) -> CheckpointConfig:
    """The config file of a trained network."""
    statistics = json.dumps(request.normalisation.as_json())
    return CheckpointConfig(
        format_version=FORMAT_VERSION,
        method=request.method,
        horizons=method_named(request.method).horizons(request.horizons),
        dimensions=network.dimensions,
        normalisation=NormalisationRecord.model_validate_json(statistics),
        network=request.network,
        head=request.head,
        training=request.training,
        training_seed=request.seed,
        sampler=request.sampler,
        provenance=request.provenance,
        parameters=parameter_counts(network),
        training_only_parameters=sum(part.numel() for part in objective.parameters()),
        flops=flops_per_evaluation(network),
        weights_sha256=sha256_bytes(weights),
        distilled=behind,
    )


def _build(
    method: Method, request: TrainingRequest, device: str, *, teacher: Checkpoint | None
) -> tuple[PolicyNetwork, Objective]:
    dimensions = _dimensions(method.horizons(request.horizons), request)
    with initial_weights(integer_seed(request.seed, "weights")):
        network = method.build(dimensions, request.network, request.head)
        objective = method.objective(dimensions, request.network, request.head)
    network = network.to(device)
    if teacher is not None:
        objective.learn_from(teacher.network.to(device), network)
    return network, objective.to(device)


def _optimise(
    network: PolicyNetwork,
    averaged: PolicyNetwork,
    objective: Objective,
    *,
    data: Batch,
    followed: Validation | None,
    request: TrainingRequest,
    device: str,
    of: Path,
) -> Iterator[dict[str, float | int | None]]:
    """Run all updates of the training of a folder; yields one record per measurement."""
    config = request.training
    trained = [*network.parameters(), *objective.parameters()]
    current: list[Tensor] = list(network.parameters())
    average: list[Tensor] = list(averaged.parameters())
    optimiser = torch.optim.AdamW(
        trained,
        lr=config.learning_rate,
        betas=(config.beta_1, config.beta_2),
        weight_decay=config.weight_decay,
    )
    generator = torch.Generator(device=device)
    generator.manual_seed(integer_seed(request.seed, "training_noise"))
    order = _batch_order(len(data.actions), config.batch_size, request.seed)
    total, counted = torch.zeros((), device=device), 0
    measured_after = moments(config)
    # Variants and seeds of one method train side by side: only their folders tell them apart.
    for update in counting(config.updates, f"{of.parent.name}/{of.name}, update"):
        rows = torch.as_tensor(next(order)).to(device)
        batch = Batch(data.observations[rows], data.actions[rows], data.weight[rows])
        for group in optimiser.param_groups:
            group["lr"] = learning_rate(update, config)
        loss = objective.loss(network, batch, generator)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(trained, config.gradient_clip)
        optimiser.step()
        with torch.no_grad():
            torch._foreach_lerp_(average, current, 1.0 - averaging_decay(update, config))
            objective.updated(network)
        total, counted = total + loss.detach(), counted + 1
        if followed and update + 1 in measured_after:
            followed.follow(update + 1, averaged, objective)
        if (update + 1) % config.validation_every == 0 or update + 1 == config.updates:
            mean_loss = float(total) / counted
            if not math.isfinite(mean_loss):
                raise NonFiniteError(
                    where=f"loss of {request.method}, update {update + 1}",
                    found=repr(mean_loss),
                    expected="a finite number",
                    action="Lower the learning rate; nothing was written.",
                )
            yield {
                "updates": update + 1,
                "training_loss": mean_loss,
                "validation_loss": followed.loss(averaged, objective) if followed else None,
                "learning_rate": learning_rate(update, config),
            }
            total, counted = torch.zeros((), device=device), 0


def _batch_order(windows: int, batch_size: int, seed: int) -> Iterator[NDArray[np.int64]]:
    """Row indices of each batch: permutation after permutation, the same for all methods."""
    generator = stream(seed, "batches")
    pool = np.empty(0, dtype=np.int64)
    while True:
        while len(pool) < batch_size:
            pool = np.concatenate([pool, generator.permutation(windows)])
        yield pool[:batch_size]
        pool = pool[batch_size:]
