"""What a ladder said of candidates: verdicts, criteria, and how far apart their chunks are."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from benchmarks.ladder_truth.bringing import FLOW
from gates.readable import limit_text, measured_text
from gates.report import Answer, GateReport, read_report, report_path
from genpolicy.candidates.brought import read_brought
from genpolicy.candidates.wire.policy import running
from genpolicy.contract.chunk import actions_sha256
from genpolicy.data.dataset import load_dataset
from genpolicy.evidence.fixtures_again import brought_fixtures, fixture_name
from genpolicy.integrity.tables import read_table
from genpolicy.policies.fixtures import CANDIDATES
from genpolicy.policies.policy import load_policy

Array = NDArray[np.float64]

GATES = "BCD"
ABSENT = "not judged"
"""Of a candidate that a gate below stopped, or of a gate that has not run."""


@dataclass(frozen=True)
class Judged:
    """What the gates said of one candidate.

    Attributes:
        verdicts: By gate.
        answers: Of each criterion that speaks of it, by gate and id.
    """

    verdicts: Mapping[str, str]
    answers: Mapping[tuple[str, str], Answer]

    @property
    def unmet(self) -> list[str]:
        """Criteria that do not hold, with their numbers."""
        return [_said(*key, answer) for key, answer in self.answers.items() if _fails(answer)]


@dataclass(frozen=True)
class Apart:
    """How far the chunks of a candidate are from those of the bare network.

    Attributes:
        largest: Largest difference, m or of a number of a rotation; NaN where no chunk came.
        identical: How many fixtures have the same bits.
        fixtures: How many were asked.
        as_judged: Whether they are, to the bit, what Gate B was answered.
    """

    largest: float
    identical: int
    fixtures: int
    as_judged: bool


def judged(workspace: Path, name: str) -> Judged:
    """What the reports as they lie there say of one candidate."""
    verdicts: dict[str, str] = {}
    answers: dict[tuple[str, str], Answer] = {}
    for gate in GATES:
        if not (workspace / report_path(gate)).exists():
            verdicts[gate] = ABSENT
            continue
        report: GateReport = read_report(workspace, gate)[0]
        verdicts[gate] = report.candidates.get(name, ABSENT)
        answers |= {(gate, a.id): a for a in report.criteria if a.candidate == name}
    return Judged(verdicts, answers)


def differing(own: Judged, twin: Judged) -> list[str]:
    """Verdicts of gates, and of criteria that both were asked, which are not the same."""
    gates = [
        f"gate {gate}: {own.verdicts[gate]}, of the twin {twin.verdicts[gate]}"
        for gate in GATES
        if own.verdicts[gate] != twin.verdicts[gate]
    ]
    criteria = [
        f"{_said(*key, answer)}, of the twin {_said(*key, twin.answers[key])}"
        for key, answer in own.answers.items()
        if key in twin.answers and answer.verdict != twin.answers[key].verdict
    ]
    return gates + criteria


def apart(workspace: Path) -> dict[str, Apart]:
    """Fixtures of Gate B, asked of every candidate that was brought and of the bare network."""
    params = yaml.safe_load((workspace / "params.yaml").read_text())
    data = load_dataset(workspace / "artifacts" / "ingest")
    network = load_policy(workspace / FLOW)
    seen = brought_fixtures(data, network.horizons)
    names = [fixture_name(row) for row in range(len(seen))]
    bare = network.sample(seen, noise_names=names, candidates=CANDIDATES).actions
    table = read_table(workspace / "artifacts" / "reload" / "samples.parquet").to_pylist()
    result = {}
    for candidate in read_brought(params["candidates"], seed=0, root=workspace):
        before = {r["row"]: r["sha256_trained"] for r in table if r["method"] == candidate.name}
        with running(candidate, data.observation_contract) as policy:
            drawn = policy.sample(seen, noise_names=names, candidates=CANDIDATES).actions
        result[candidate.name] = compared(drawn, bare, before)
    return result


def compared(drawn: Array, bare: Array, before: Mapping[int, str]) -> Apart:
    """Chunks of each fixture against those of the bare network, and against hashes at Gate B."""
    now = {row: actions_sha256(chunks) for row, chunks in enumerate(drawn)}
    own = {row: actions_sha256(chunks) for row, chunks in enumerate(bare)}
    return Apart(
        largest=float(np.abs(drawn - bare).max()),
        identical=sum(now[row] == own[row] for row in now),
        fixtures=len(now),
        as_judged=now == dict(before),
    )


def _fails(answer: Answer) -> bool:
    return answer.verdict != "PASS"


def _said(gate: str, name: str, answer: Answer) -> str:
    return f"{gate} {name} {answer.verdict} ({measured_text(answer)}, limit {limit_text(answer)})"
