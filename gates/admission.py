"""Admission: what a stage calls before its first line of work.

Every gate below the stage is proved again, from the bytes up; only then, and only if each one
passes, does the stage begin.
"""

from dataclasses import dataclass
from pathlib import Path

from gates.chain import require_pass, verify_report
from gates.models import GATES, Gate, GateReport
from gates.registry import judge_lower
from genpolicy.errors import ConfigError

STAGE_REQUIRES: dict[str, Gate | None] = {
    "record": None,
    "ingest": None,
    "audit": None,
    "train_baselines": None,
    "measure_baselines": None,
    "train_factors": None,
    "measure_factors": None,
    "gate_a": None,
    "train_generators": "A",
    "reload": "A",
    "latency": "A",
    "gate_b": None,
    "shadow": "B",
    "gate_c": None,
    "stress": "C",
    "gate_d": None,
    "card": "D",
    "gate_e": None,
}


@dataclass(frozen=True)
class Admission:
    """Why a stage may begin.

    Attributes:
        stage: The stage.
        reports: Proved and passed report of each gate below it.
        hashes: SHA-256 of those reports.
    """

    stage: str
    reports: dict[str, GateReport]
    hashes: dict[str, str]

    @property
    def candidates(self) -> tuple[str, ...]:
        """Methods that passed the highest gate below the stage; empty before Gate B."""
        if not self.reports:
            return ()
        last = self.reports[max(self.reports)]
        return tuple(name for name, verdict in last.candidates.items() if verdict == "PASS")


def admit(stage: str, root: Path) -> Admission:
    """Let a stage begin, or refuse.

    Args:
        stage: Name of the stage; gate stages and those before Gate A need no gate.
        root: Repository root.

    Raises:
        ConfigError: No such stage, or `params.yaml` is wrong.
        IntegrityError: A report is malformed or of another schema version; run its gate again.
        RefusedError: A report is missing, untrue, or not PASS.
    """
    if stage not in STAGE_REQUIRES:
        raise ConfigError(
            where="stage",
            found=repr(stage),
            expected=f"one of {', '.join(STAGE_REQUIRES)}",
            action="Register the stage in gates.admission.STAGE_REQUIRES.",
        )
    needed = STAGE_REQUIRES[stage]
    reports, hashes = prove_chain(root, needed) if needed else ({}, {})
    return Admission(stage, reports, hashes)


def prove_chain(root: Path, through: Gate) -> tuple[dict[str, GateReport], dict[str, str]]:
    """Prove every gate up to `through`, at most D, and require PASS of each.

    Returns:
        Report and SHA-256 by gate.

    Raises:
        IntegrityError: A report is malformed or of another schema version.
        RefusedError: A report is missing, untrue, or not PASS.
    """
    reports: dict[str, GateReport] = {}
    hashes: dict[str, str] = {}
    for gate in GATES[: GATES.index(through) + 1]:
        report, digest = verify_report(root, gate, upstream=dict(hashes), judging=judge_lower)
        require_pass(gate, report)
        reports[gate], hashes[gate] = report, digest
    return reports, hashes
