"""A judged workspace in which every part of the eleven groups has a file."""

import shutil
from pathlib import Path

import evidence
import pytest

from gates.ledger.claims import LEDGER
from gates.package.groups import STRESS
from gates.proof import judge
from gates.report import report_bytes, report_path
from genpolicy.evidence.rows.stress import AgeRow
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.rows import write_rows


@pytest.fixture(scope="session")
def _whole(tmp_path_factory: pytest.TempPathFactory, _ladder: Path) -> Path:
    root = tmp_path_factory.mktemp("whole") / "repo"
    shutil.copytree(_ladder, root)
    (root / "limits.yaml").write_text("{}\n")
    (root / LEDGER).parent.mkdir(parents=True, exist_ok=True)
    (root / LEDGER).write_text("claims: []\n")
    write_rows(root / STRESS / "ages.parquet", AgeRow, [AgeRow("flow", "nominal", 0.5, 0.2, 9)])
    (root / STRESS / "journals").mkdir(exist_ok=True)
    (root / STRESS / "journals" / "flow__nominal.mcap").write_bytes(b"a journal")
    evidence.record(root)
    write_bytes(root / report_path("D"), report_bytes(judge(root, "D")))
    return root


@pytest.fixture
def whole(tmp_path: Path, _whole: Path) -> Path:
    """A copy to package or to harm."""
    shutil.copytree(_whole, tmp_path / "whole")
    return tmp_path / "whole"
