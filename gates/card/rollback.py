"""What runs instead: one simple policy, by its checkpoint and by what it did on the same starts."""

from collections.abc import Mapping
from dataclasses import dataclass

from gates.evidence import Evidence, MissingEvidenceError, flags
from gates.pipeline import TASK
from gates.report import Gate, GateReport, parse_section
from gates.stress.rollouts import ROLLOUTS, StressSettings
from gates.stress.utility import mean_worth
from genpolicy.contract.planner import PLANNER, planner_sha256
from genpolicy.documents.task import IDENTITY
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.evidence.rows.stress import RolloutRow

TRAINED = "artifacts/train_baselines"
WEIGHTS = "model.safetensors"
SETTINGS = "reports/gate_d.json: settings"


@dataclass(frozen=True)
class Rollback:
    """One policy to go back to.

    Attributes:
        policy: Name of the simple method.
        checkpoint_sha256: Of the weights of its first seed, as gate A's report names them; of the
            task's planner, its identity.
        succeeded: Rollouts of the comparison in which it succeeded.
        rollouts: Of how many, all planned conditions together.
        utility: What they were worth on average; None where success alone is compared.
    """

    policy: str
    checkpoint_sha256: str
    succeeded: int
    rollouts: int
    utility: float | None = None

    @property
    def text(self) -> str:
        """As a card says it."""
        worth = "" if self.utility is None else f" at a mean utility of {self.utility:.4g}"
        return (
            f"stop, then {self.policy} (checkpoint {self.checkpoint_sha256}), which succeeded in "
            f"{self.succeeded} of {self.rollouts} rollouts{worth} on the same starts, or manual "
            "control"
        )


def rollback_of(reports: Mapping[Gate, GateReport], evidence: Evidence) -> Rollback:
    """The simple method that is worth most over all planned conditions; of equals the first.

    Success, or utility where Gate D compared that: the best one is the same there and here.

    Args:
        reports: Of gates A and D at least.
        evidence: Below the same root.

    Raises:
        IntegrityError: No simple method rolled out, gate A's report names no weights of it, or the
            task of a planner is not known.
    """
    try:
        settings = parse_section(StressSettings, reports["D"].settings, where=SETTINGS)
        rows = evidence.rows(ROLLOUTS, RolloutRow)
        rows = rows[rows["perturbation"].isin(settings.perturbations)]
        tried = {name: rows[rows["method"] == name] for name in settings.baselines}
        worth = {
            name: mean_worth(evidence, settings, name, of) for name, of in tried.items() if len(of)
        }
    except (MissingEvidenceError, ConfigError) as error:
        raise _unknown(ROLLOUTS, str(error), "rollouts of the simple methods") from error
    if not worth:
        raise _unknown(ROLLOUTS, "no rollout of a simple method", "the comparison of gate D")
    best = max(worth, key=lambda name: worth[name])
    checkpoint = _checkpoint(best, reports["A"], evidence)
    won = flags(tried[best], "success")
    utility = worth[best] if settings.utility else None
    return Rollback(best, checkpoint, int(won.sum()), len(won), utility)


def _checkpoint(best: str, need: GateReport, evidence: Evidence) -> str:
    """SHA-256 of a simple method; of the planner, by the task that this ladder is about."""
    if best == PLANNER:
        try:
            return planner_sha256(evidence.document(TASK, IDENTITY).sha256)
        except MissingEvidenceError as error:
            where = f"{TASK}/{IDENTITY.file}"
            raise _unknown(where, str(error), "the task whose planner did best") from error
    weights = sorted(
        (path, digest)
        for path, digest in need.materials.items()
        if path.startswith(f"{TRAINED}/{best}/") and path.endswith(f"/{WEIGHTS}")
    )
    if not weights:
        raise _unknown("reports/gate_a.json: materials", f"no weights of {best}", "their hash")
    return weights[0][1]


def require_rollback(text: str, reports: Mapping[Gate, GateReport], evidence: Evidence) -> None:
    """Require that a draft rolls back to the policy that the comparison shows to do best.

    Raises:
        IntegrityError: It names something else, or as `rollback_of`.
    """
    expected = rollback_of(reports, evidence).text
    if text != expected:
        raise IntegrityError(
            where="the draft's rollback",
            found=repr(text[:60]),
            expected=expected,
            action="Draft the card again: `dvc repro card`.",
        )


def _unknown(where: str, found: str, expected: str) -> IntegrityError:
    return IntegrityError(
        where=where, found=found, expected=expected, action="Run the ladder again: `dvc repro`."
    )
