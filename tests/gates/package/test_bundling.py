"""Bundles of synthetic evidence: who is packaged, and what is refused before anything is judged.

That a bundle of a real ladder is proved elsewhere, and that no forged one is: tests/ladder.
"""

import json
import shutil
import zipfile

import pytest

from gates.package import bundling
from gates.package.archive import read_index
from gates.package.bundling import package
from gates.package.statements import statement_path
from gates.proof import prove_all
from gates.report import Overridden, read_report, report_bytes, report_path
from genpolicy.errors import BadInputError, ConfigError, RefusedError
from genpolicy.integrity.atomic import write_bytes


def test_a_bundle_names_groups_verdicts_and_statements(whole, tmp_path):
    done = package(whole, "flow", tmp_path / "flow.zip")
    index = read_index(done.path)
    assert index == done.index
    assert [group.number for group in index.groups] == list(range(1, 12))
    assert index.verdicts == {g: read_report(whole, g)[0].verdict for g in "ABCD"}
    with zipfile.ZipFile(done.path) as archive:
        said = json.loads(archive.read(statement_path("B")))
    assert said["subject"][0]["digest"]["sha256"] == index.checkpoint
    assert "artifacts/monitors/alarms.parquet" in index.groups[9].files
    assert not any(group.unmeasured for group in index.groups)


def test_by_default_its_name_has_the_address(whole):
    done = package(whole, "flow")
    assert done.path.name == f"flow-{done.index.address[:12]}.zip"
    assert done.path.parent == whole / "build" / "bundles"


@pytest.mark.parametrize("gate", ["A", "B", "C", "D"])
def test_without_a_report_there_is_no_bundle(whole, tmp_path, gate):
    (whole / report_path(gate)).unlink()
    with pytest.raises(RefusedError, match=rf"^Gate {gate} refuses: report is missing, required a"):
        package(whole, "flow", tmp_path / "flow.zip")
    assert not (tmp_path / "flow.zip").exists()


def _without_evidence(root):
    shutil.rmtree(root / "artifacts")


def _with_another_report_below(root):
    path = root / report_path("B")
    write_bytes(path, report_bytes(read_report(root, "B")[0].model_copy(update={"decision": "x"})))


def _with_another_file(root):
    (root / "artifacts/audit/more.parquet").write_bytes(b"")


@pytest.mark.parametrize(("harm", "said"), [
    (_without_evidence, "Gate A refuses: sha256 of artifacts/"),
    (_with_another_report_below, "Gate B refuses: "),
    (_with_another_file, "Gate A refuses: artifacts/audit/more.parquet is a file that nobody"),
])  # fmt: skip
def test_what_a_gate_refuses_is_said_once_and_as_the_gate_says_it(whole, tmp_path, harm, said):
    """A clone has the reports and none of the evidence: one reads what to run."""
    harm(whole)
    with pytest.raises(RefusedError) as found:
        package(whole, "flow", tmp_path / "flow.zip")
    assert str(found.value).startswith(said) and "dvc repro" in str(found.value)
    assert all(line.count("refuses:") == 1 for line in str(found.value).splitlines())
    assert str(found.value) in {rung.note for rung in prove_all(whole)}


def test_evidence_that_was_changed_has_no_bundle(whole, tmp_path):
    (whole / "artifacts/stress/journals/flow__nominal.mcap").write_bytes(b"another")
    with pytest.raises(RefusedError, match="Gate D"):
        package(whole, "flow", tmp_path / "flow.zip")
    assert not (tmp_path / "flow.zip").exists()


def test_an_incomplete_candidate_has_no_bundle(whole, tmp_path):
    with pytest.raises(BadInputError, match="eleven groups"):
        package(whole, "act", tmp_path / "act.zip")
    assert not (tmp_path / "act.zip").exists()


def test_a_candidate_that_fails_the_last_gate_has_a_bundle_too(whole, tmp_path):
    assert read_report(whole, "D")[0].verdict != "PASS"
    assert package(whole, "flow", tmp_path / "flow.zip").index.verdicts["D"] != "PASS"


def test_a_name_that_not_every_machine_can_write_is_told(whole, tmp_path):
    odd = whole / "gates" / "a\\b.py"
    odd.parent.mkdir(exist_ok=True)
    odd.write_text("")
    with pytest.raises(BadInputError, match="no path below the workspace"):
        package(whole, "flow", tmp_path / "flow.zip")


def test_programs_are_marked(whole, tmp_path):
    (whole / "gates").mkdir(exist_ok=True)
    (whole / "gates/run.sh").write_text("")
    (whole / "gates/run.sh").chmod(0o755)
    (whole / "gates/of_others.sh").write_text("")
    (whole / "gates/of_others.sh").chmod(0o645)
    files = package(whole, "flow", tmp_path / "flow.zip").index.files
    assert [name for name, file in files.items() if file.executable] == ["gates/run.sh"]


@pytest.mark.parametrize(("clean", "commit"), [("", "c" * 40), (None, "")])
def test_a_commit_is_named_only_if_the_code_is_of_it(whole, tmp_path, monkeypatch, clean, commit):
    said = {"diff": clean, "rev-parse": "c" * 40}
    monkeypatch.setattr(bundling, "git", lambda root, *words: said[words[0]])
    assert package(whole, "flow", tmp_path / "flow.zip").index.commit == commit


def test_nobody_packages_what_stands_on_an_exception_that_is_over(whole, tmp_path, monkeypatch):
    """Whoever verifies a bundle later has no day to ask it of: who makes one has."""
    entry = Overridden(
        gate="D", criterion="hold_share_upper", candidate="flow", limit=0.3, by="rita",
        reason="r", expires="2020-01-01", comparison="<=", threshold=0.25, verdict="FAIL",
        instead="PASS", without="FAIL",
    )  # fmt: skip
    real = bundling.read_report

    def overridden(root, gate):
        report, digest = real(root, gate)
        held = (entry,) if gate == "D" else ()
        return report.model_copy(update={"overrides": held}), digest

    monkeypatch.setattr(bundling, "read_report", overridden)
    with pytest.raises(ConfigError, match="over since 2020-01-01"):
        package(whole, "flow", tmp_path / "flow.zip")
    assert not (tmp_path / "flow.zip").exists()
