"""Table of what networks and their trainings cost (Gate B)."""

from gates.distilled import spent
from gates.evidence import Evidence, MissingEvidenceError
from gates.need.settings import TRAINED as BASELINES
from gates.pages.bound import require_bound
from gates.pages.figures import Listing, Table
from gates.report import GateReport
from gates.reproducibility.compute import COMPUTE, Cost, cost_of
from gates.reproducibility.convergence import last_quarter, updates_of
from gates.reproducibility.settings import GENERATORS, chosen_nfe
from gates.words import share_between
from genpolicy.evidence.documents.given import MATCHED, DistilledConfig, TrainedConfig
from genpolicy.evidence.rows.reproducibility import PARTS

HEADS = (
    "method", *(f"{part}: parameters, operations" for part in PARTS), "operations of a sample",
    "updates, windows of each", "operations of one training",
    "held-out loss still falls, last quarter", "distillation",
)  # fmt: skip
NOT_COUNTED = "not counted"


def _costs(evidence: Evidence, report: GateReport) -> Table:
    """Candidates as they were counted, then baselines as training wrote."""
    require_bound(evidence, report, COMPUTE)
    confidence = float(report.settings["confidence"])
    named = {GENERATORS: list(report.candidates), BASELINES: report.settings["baselines"]}
    lines = []
    for root, methods in named.items():
        known = evidence.document(root, MATCHED).methods
        for method in methods:
            if method not in known:
                continue
            config = known[method].config
            cost = cost_of(evidence, method, config) if root == GENERATORS else None
            lines.append(
                (
                    method,
                    *_network(config, cost),
                    _of_a_sample(evidence, method, cost) if cost else NOT_COUNTED,
                    f"{updates_of(evidence, root, method)} of {config.training.batch_size}",
                    f"{cost.training:.3g}" if cost else NOT_COUNTED,
                    _falls(evidence, root, method, confidence),
                    spent(config.distilled) if isinstance(config, DistilledConfig) else "none",
                )
            )
    return (HEADS, *lines)


def _network(config: TrainedConfig, cost: Cost | None) -> list[str]:
    parameters = cost.parameters if cost else config.parameters
    operations = cost.operations if cost else config.flops
    return [f"{parameters[part]}, {operations[part]:.3g}" for part in PARTS]


def _of_a_sample(evidence: Evidence, method: str, cost: Cost) -> str:
    """The encoder once, trunk and head as often as its sampler evaluates them at most."""
    _, most = chosen_nfe(evidence, method)
    return f"{cost.operations['encoder'] + most * cost.evaluation:.3g} at NFE {most:g}"


def _falls(evidence: Evidence, root: str, method: str, confidence: float) -> str:
    try:
        fall = last_quarter(evidence, root, method, confidence=confidence)
    except MissingEvidenceError as error:
        return str(error)
    return share_between(fall.share, *fall.interval)


LISTING = Listing(
    "What does it cost?",
    "Parameters and operations (multiplications and additions of matrix products) of one row: the "
    "encoder runs once an invocation, trunk and head once a network evaluation. Candidates are "
    "counted where they run (torch's counter), loss and gradient of a window among it; baselines "
    "are as their training wrote, and their updates are as many. Every training stops after a "
    "number of updates that was written before: held-out loss is measured, and stops and selects "
    "nothing. How long a training took is in no artifact, since the same inputs give the same "
    "bytes.",
    COMPUTE,
    _costs,
)
