"""Reports of the synthetic ladder, judged once, and of a tree in which a cause was planted."""

import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from gates.diagnosis.reports import OF_EVIDENCE, Reports
from gates.evidence import Evidence
from gates.proof import judge
from gates.report import read_report


@pytest.fixture(scope="session")
def honest(_ladder: Path) -> Reports:
    """Every gate passes, and nothing is planted; not proved again, since it was judged just now."""
    judged = {gate: read_report(_ladder, gate)[0] for gate in OF_EVIDENCE}
    missing = {"E": "gate E is not judged here: run `dvc repro gate_e`, or `make ladder`"}
    return Reports(_ladder, judged, missing, 0, Evidence(_ladder))


@pytest.fixture
def planted(tmp_path: Path, _ladder: Path, honest: Reports):
    """Reports after an edit of the evidence: `planted(edit, "CD")` judges those gates again."""

    def plant(edit, gates: str) -> Reports:
        root = tmp_path / "planted"
        shutil.copytree(_ladder, root)
        edit(root)
        again = {gate: judge(root, gate) for gate in OF_EVIDENCE if gate in gates}
        return Reports(root, {**honest.judged, **again}, honest.missing, 0, Evidence(root))

    return plant
