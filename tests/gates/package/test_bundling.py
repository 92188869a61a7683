"""Bundles of synthetic evidence: who is packaged, and what is refused before anything is judged.

That a bundle of a real ladder is proved elsewhere, and that no forged one is: tests/ladder.
"""

import json
import zipfile

import pytest

from gates.package.archive import read_index
from gates.package.bundling import package, prove_bundle
from gates.package.statements import statement_path
from gates.report import read_report, report_path
from genpolicy.errors import BadInputError, IntegrityError, RefusedError


def test_a_bundle_names_groups_verdicts_and_statements(whole, tmp_path):
    done = package(whole, "flow", tmp_path / "flow.zip")
    index = read_index(done.path)
    assert index == done.index
    assert [group.number for group in index.groups] == list(range(1, 12))
    assert index.verdicts == {g: read_report(whole, g)[0].verdict for g in "ABCD"}
    with zipfile.ZipFile(done.path) as archive:
        said = json.loads(archive.read(statement_path("B")))
    assert said["subject"][0]["digest"]["sha256"] == index.checkpoint
    assert "out-of-distribution" in index.groups[9].unmeasured


def test_by_default_its_name_has_the_address(whole):
    done = package(whole, "flow")
    assert done.path.name == f"flow-{done.index.address[:12]}.zip"
    assert done.path.parent == whole / "build" / "bundles"


@pytest.mark.parametrize("gate", ["A", "B", "C", "D"])
def test_without_a_report_there_is_no_bundle(whole, tmp_path, gate):
    (whole / report_path(gate)).unlink()
    with pytest.raises(RefusedError, match=r"Gate [A-D] refuses: the report"):
        package(whole, "flow", tmp_path / "flow.zip")
    assert not (tmp_path / "flow.zip").exists()


def test_evidence_that_was_changed_has_no_bundle(whole, tmp_path):
    (whole / "artifacts/stress/journals/flow__nominal.mcap").write_bytes(b"another")
    with pytest.raises(RefusedError, match="Gate D"):
        package(whole, "flow", tmp_path / "flow.zip")
    assert not (tmp_path / "flow.zip").exists()


def test_an_incomplete_candidate_has_no_bundle(whole, tmp_path):
    with pytest.raises(BadInputError, match="eleven groups"):
        package(whole, "act", tmp_path / "act.zip")
    assert not (tmp_path / "act.zip").exists()


def test_evidence_of_other_code_is_not_proved_by_this(whole, tmp_path):
    package(whole, "flow", tmp_path / "flow.zip")
    (tmp_path / "out").mkdir()
    with pytest.raises(IntegrityError, match="other code than runs here"):
        prove_bundle(tmp_path / "flow.zip", tmp_path / "out", run_programs=False)
