"""What a training rests on: weights that it takes over, or a teacher that it distils."""

from collections.abc import Iterable
from pathlib import Path

from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.policies.checkpoint import Checkpoint, Distilled, load_checkpoint
from genpolicy.policies.distillation import EVALUATIONS_PER_WINDOW, GRADIENTS_PER_WINDOW
from genpolicy.policies.methods import Method, method_named
from genpolicy.policies.networks import PolicyNetwork
from genpolicy.policies.training_request import TrainingRequest


def source_folder(folder: Path, method: str, trained: Iterable[str], seed: int) -> Path | None:
    """Checkpoint folder that a method rests on, trained in the same stage; None without one.

    Args:
        folder: Folder of the stage; checkpoints go into `<method>/seed_<n>`.
        method: Registered name.
        trained: Methods that the stage trains.
        seed: Number of the training seed.

    Raises:
        ConfigError: The stage does not train what the method rests on.
    """
    chosen = method_named(method)
    source = chosen.rests_on
    if source is None:
        return None
    if source not in trained:
        role = "the teacher of" if chosen.teacher else "whose weights are taken over by"
        raise ConfigError(
            where=f"samplers of the stage that trains {method}",
            found=f"without {source}",
            expected=f"{source}, {role} {method}",
            action=f"Train {source} in the same stage, or leave {method} out.",
        )
    return folder / source / f"seed_{seed}"


def take_over(
    network: PolicyNetwork, folder: Path, request: TrainingRequest
) -> dict[str, float | int | None]:
    """Put the weights of a trained checkpoint into a network; returns its last record.

    Raises:
        IntegrityError: The checkpoint is damaged, or was trained with other settings.
    """
    checkpoint = load_checkpoint(folder)
    config = checkpoint.config
    asked = (request.network, request.training, request.provenance, request.seed)
    if (config.network, config.training, config.provenance, config.training_seed) != asked:
        raise IntegrityError(
            where=str(folder),
            found="a checkpoint that was trained with other settings",
            expected="network, training, data and seed of the method that takes over its weights",
            action="Train both in one run (`dvc repro train_baselines`).",
        )
    network.load_state_dict({**network.state_dict(), **checkpoint.network.state_dict()})
    return {"updates": config.training.updates, "training_loss": None, "validation_loss": None}


def teacher_of(method: Method, folder: Path | None, request: TrainingRequest) -> Checkpoint | None:
    """The trained teacher of a method; None for a method that has none.

    The comparison of methods allows no other difference than method, sampler and seed; a teacher
    that saw other data, or was trained longer, would be one that nobody sees in the student.

    Args:
        method: The student.
        folder: Checkpoint folder of the teacher; None where none was given.
        request: What the student is trained with.

    Raises:
        ConfigError: The method has a teacher, and none was given.
        IntegrityError: The checkpoint is damaged, of another method, or was trained differently.
    """
    if method.teacher is None:
        return None
    if folder is None:
        raise ConfigError(
            where=f"training of {method.name}",
            found="no checkpoint of its teacher",
            expected=f"one of {method.teacher}",
            action=f"Train {method.teacher} in the same stage, and {method.name} behind it.",
        )
    checkpoint = load_checkpoint(folder)
    config = checkpoint.config
    found = {
        "method": (config.method, method.teacher),
        "horizons": (config.horizons, method.horizons(request.horizons)),
        "normalisation": (checkpoint.normalisation.as_json(), request.normalisation.as_json()),
        "network": (config.network, request.network),
        "head": (config.head, request.head),
        "training": (config.training, request.training),
        "training_seed": (config.training_seed, request.seed),
        "provenance": (config.provenance, request.provenance),
    }
    other = [name for name, (own, asked) in found.items() if own != asked]
    if other:
        raise IntegrityError(
            where=str(folder),
            found=f"a teacher with another {', '.join(other)}",
            expected=f"{method.teacher}, trained with the settings of {method.name}",
            action="Train both in one run (`dvc repro train_generators`).",
        )
    return checkpoint


def distilled(teacher: Checkpoint | None, request: TrainingRequest) -> Distilled | None:
    """The teacher of a checkpoint, if any, and what both trainings took without validation."""
    if teacher is None:
        return None
    own, before = request.training, teacher.config.training
    windows, windows_before = own.updates * own.batch_size, before.updates * before.batch_size
    return Distilled(
        teacher=teacher.config.method,
        teacher_sha256=teacher.sha256,
        updates=own.updates + before.updates,
        evaluations=windows * EVALUATIONS_PER_WINDOW + windows_before,
        gradients=windows * GRADIENTS_PER_WINDOW + windows_before,
    )
