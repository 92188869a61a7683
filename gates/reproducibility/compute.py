"""What a candidate's network and its training cost, counted, beside what training wrote of itself.

Nothing is judged by what it costs: a count that contradicts the checkpoint's own is an item that is
not pinned. What it costs is told with the parameter budget.
"""

from dataclasses import dataclass

from gates.evidence import Evidence, MissingEvidenceError
from gates.reproducibility.convergence import updates_of
from gates.reproducibility.settings import GENERATORS, RELOAD, fixtures_of
from genpolicy.evidence.documents.given import TrainedConfig
from genpolicy.evidence.rows.reproducibility import PARTS, UPDATE, ComputeRow

COMPUTE = f"{RELOAD}/compute.parquet"
TRUNK, TOTAL = "trunk", "total"
STOPS = "a number that was written before, no loss stops or selects"
"""The only stopping rule there is: training measures held-out loss, and does nothing by it."""


@dataclass(frozen=True)
class Cost:
    """What one candidate costs, of its first training seed.

    Attributes:
        parameters: By part.
        operations: Of one row, by part.
        training_only: Parameters that exist in training only.
        window: Operations of one window's loss and gradient.
        updates: Of the training.
        batch: Windows of an update.
    """

    parameters: dict[str, int]
    operations: dict[str, int]
    training_only: int
    window: int
    updates: int
    batch: int

    @property
    def evaluation(self) -> int:
        """Operations of one network evaluation of one row."""
        return sum(self.operations.values()) - self.operations["encoder"]

    @property
    def training(self) -> float:
        """Operations of all updates, of one training seed."""
        return float(self.window) * self.batch * self.updates


def cost_of(evidence: Evidence, candidate: str, config: TrainedConfig) -> Cost:
    """What was counted of a candidate.

    Raises:
        MissingEvidenceError: A part was not counted, or twice, not of every training seed of which
            samples were drawn, or its seeds are of several sizes.
    """
    rows, seeds = evidence.of(COMPUTE, ComputeRow, candidate), fixtures_of(evidence, candidate)
    counted = {}
    for part in (*PARTS, UPDATE):
        own = rows[rows["part"] == part]
        sizes = set(zip(own["parameters"], own["operations"], strict=True))
        if len(sizes) != 1 or sorted(own["seed"]) != sorted(seeds):
            raise MissingEvidenceError(f"{COMPUTE} does not count {part} of {candidate} once")
        counted[part] = next(iter(sizes))
    return Cost(
        parameters={part: int(counted[part][0]) for part in PARTS},
        operations={part: int(counted[part][1]) for part in PARTS},
        training_only=int(counted[UPDATE][0]),
        window=int(counted[UPDATE][1]),
        updates=updates_of(evidence, GENERATORS, candidate),
        batch=config.training.batch_size,
    )


def miscounted(cost: Cost, config: TrainedConfig) -> list[str]:
    """Parts whose parameters, or operations of linear layers, are others than training wrote."""
    only, said = cost.training_only, config.training_only_parameters
    found = [] if only == said else [f"training-only parameters: counted {only}, trained as {said}"]
    found += [
        f"parameters of {part}: counted {cost.parameters[part]}, "
        f"trained as {config.parameters.get(part)}"
        for part in PARTS
        if cost.parameters[part] != config.parameters.get(part)
    ]
    total, said_in_all = sum(cost.parameters.values()), config.parameters.get(TOTAL)
    if not found and total != said_in_all:
        found.append(f"parameters of all parts: counted {total}, trained as {said_in_all}")
    if not (cost.evaluation > 0 and cost.window > 0):
        found.append("operations: none of an evaluation, or none of a window's training")
    for part in PARTS:
        counted, wrote = cost.operations[part], config.flops.get(part)
        # Products outside of layers (attention, in the trunk) are counted here alone.
        more = part == TRUNK and wrote is not None and counted >= wrote
        if counted != wrote and not more:
            found.append(f"operations of {part}: counted {counted}, trained as {wrote}")
    return found


def cost_said(cost: Cost) -> str:
    """Parts and training, as a report says them."""
    parts = ", ".join(
        f"{part} {cost.parameters[part]} and {cost.operations[part]:.3g}" for part in PARTS
    )
    return (
        f"parameters and operations of one row: {parts}; training: {cost.updates} updates "
        f"({STOPS}) of {cost.batch} windows, {cost.training:.3g} operations"
    )
