"""What a network costs: parameters and operations of its parts, and operations of its training.

Counted where it runs, by torch's own counter, and not read from what training wrote: a gate holds
one against the other. How long it took is in no evidence, since the same inputs give the same
bytes; operations are what two trainings can be compared by.
"""

import copy
from collections.abc import Iterator
from contextlib import contextmanager

import torch
from torch import Tensor, nn
from torch.utils.flop_counter import FlopCounterMode

from genpolicy.candidates.judged import JudgedPolicy
from genpolicy.evidence.rows.reproducibility import PARTS, UPDATE, ComputeRow
from genpolicy.policies.checkpoint import CheckpointConfig, load_checkpoint
from genpolicy.policies.methods import method_named, noise_shape
from genpolicy.policies.networks import PolicyNetwork
from genpolicy.policies.objectives import Batch
from genpolicy.policies.settings import SamplerConfig

COUNTED_ROWS = 2
"""Windows of the counted update: a row costs what it costs, however many there are."""


def compute_rows(candidate: JudgedPolicy) -> list[ComputeRow]:
    """Parts of one checkpoint, and one update of its training, counted on the CPU."""
    checkpoint = load_checkpoint(candidate.folder, expected_sha256=candidate.sha256)
    network, config = checkpoint.network, checkpoint.config
    spent = part_operations(network, config, config.sampler)
    parameters = {
        part: sum(values.numel() for values in getattr(network, part).parameters())
        for part in PARTS
    }
    only, operations = update_operations(candidate, network, config)
    counts = {part: (parameters[part], spent[part]) for part in PARTS}
    return [
        ComputeRow(candidate.name, candidate.seed, part, *own)
        for part, own in {**counts, UPDATE: (only, operations)}.items()
    ]


def part_operations(
    network: PolicyNetwork, config: CheckpointConfig, sampler: SamplerConfig
) -> dict[str, int]:
    """Operations of one row, by part; products outside of layers (attention) are the trunk's.

    A row of an energy is all candidates of its population.
    """
    sizes, method = config.dimensions, method_named(config.method)
    observed = torch.zeros(1, sizes.observation_horizon, sizes.observation_dim)
    values = None
    if method.reads == "codes":
        length = min(config.head.code_dim, sizes.chunk_numbers)
        values = torch.zeros(1, sampler.population, length)
    elif method.reads != "nothing":
        values = torch.zeros(1, *noise_shape(sizes, sampler, config.head))
    time = torch.zeros(1) if method.gains is not None else None
    with _by_layer(network) as (counter, spent):
        network.evaluate(network.encode(observed), values, time)
    spent["trunk"] += counter.get_total_flops() - sum(spent.values())
    return spent


def update_operations(
    candidate: JudgedPolicy, network: PolicyNetwork, config: CheckpointConfig
) -> tuple[int, int]:
    """Parameters of its objective, and operations of a window's loss and gradient.

    What its teacher evaluates for it is among them, what trained the teacher is not.
    """
    sizes, method = config.dimensions, method_named(config.method)
    objective = method.objective(sizes, config.network, config.head)
    learning = copy.deepcopy(network).requires_grad_(True)
    if method.teacher is not None:
        root, seed = candidate.folder.parent.parent, candidate.folder.name
        objective.learn_from(load_checkpoint(root / method.teacher / seed).network, learning)
    generator = torch.Generator().manual_seed(0)

    def some(*shape: int) -> Tensor:
        return torch.randn(COUNTED_ROWS, *shape, generator=generator)

    batch = Batch(
        some(sizes.observation_horizon, sizes.observation_dim),
        some(sizes.prediction_horizon, sizes.action_dim),
        torch.ones(COUNTED_ROWS, sizes.prediction_horizon, 1),
    )
    objective.prepare(learning, batch)
    with FlopCounterMode(display=False) as counter:
        objective.loss(learning, batch, generator).backward()  # type: ignore[no-untyped-call]
    only = sum(values.numel() for values in objective.parameters())
    return only, counter.get_total_flops() // COUNTED_ROWS


@contextmanager
def _by_layer(network: PolicyNetwork) -> Iterator[tuple[FlopCounterMode, dict[str, int]]]:
    """A counter of all operations, and by part those of its linear layers."""
    spent = dict.fromkeys(PARTS, 0)
    with FlopCounterMode(display=False) as counter:
        hooks = []
        for part in PARTS:

            def before(*_: object, part: str = part) -> None:
                spent[part] -= counter.get_total_flops()

            def after(*_: object, part: str = part) -> None:
                spent[part] += counter.get_total_flops()

            for layer in getattr(network, part).modules():
                if isinstance(layer, nn.Linear):
                    hooks.append(layer.register_forward_pre_hook(before))
                    hooks.append(layer.register_forward_hook(after))
        try:
            yield counter, spent
        finally:
            for hook in hooks:
                hook.remove()
