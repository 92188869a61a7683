"""`genpolicy package` and `genpolicy verify bundle`: what is printed, and exit codes."""

import json

import pytest

from gates.commands import verify
from gates.package import bundling, proving
from gates.package.archive import read_index
from gates.package.bundling import Packaged
from gates.package.commands import package
from gates.package.index import BundledFile, BundledGroup, BundleIndex
from gates.proof import Rung
from genpolicy.cli.shell import run_program


@pytest.fixture
def run(capsys):
    def run(command, *arguments):
        code = run_program(command, "genpolicy", [str(word) for word in arguments])
        printed = capsys.readouterr()
        return code, printed.out + printed.err

    return run


@pytest.fixture
def bundle(whole, tmp_path, run):
    code, said = run(package, "flow", "--out", tmp_path / "flow.zip", "--root", whole)
    assert code == 0, said
    assert f"Address {read_index(tmp_path / 'flow.zip').address}" in said
    assert "not measured" not in said, "probes were run, and their rows are in the bundle"
    return tmp_path / "flow.zip"


@pytest.fixture
def proved(monkeypatch):
    """Verdicts that a bundle is said to have; the ladder's tests prove real ones."""
    given = {}

    def of(*verdicts):
        rungs = [
            Rung(gate, "name", verdict, "", "note", "report", 0 if verdict == "PASS" else 3)
            for gate, verdict in zip("ABCD", verdicts, strict=True)
        ]

        def prove(path, folder, **options):
            given.update(options, empty=not list(folder.iterdir()))
            return read_index(path), rungs

        monkeypatch.setattr(proving, "prove_bundle", prove)
        return given

    return of


def test_what_holds_exits_0_whatever_the_verdicts_are(run, bundle, proved):
    proved("PASS", "PASS", "FAIL", "INCONCLUSIVE")
    code, said = run(verify, "bundle", bundle)
    assert code == 0 and "files are what the address names" in said


def test_what_was_packaged_is_told_line_by_line(run, monkeypatch, tmp_path):
    """Of 3.5 MiB in two files; nothing is judged for it."""
    files = {name: BundledFile(sha256="a" * 64, size=7 << 18) for name in ("x", "y")}
    index = BundleIndex(
        schema_version=1, candidate="flow", checkpoint="a" * 64, commit="",
        verdicts={"A": "PASS", "D": "FAIL"},
        groups=[
            BundledGroup(number=1, title="dataset", files=["x"]),
            BundledGroup(number=10, title="safety", files=["x", "y"], unmeasured="no probe"),
        ],
        files=files, statements={}, limits=[],
    )  # fmt: skip
    done = Packaged(tmp_path / "flow.zip", index)
    monkeypatch.setattr(bundling, "package", lambda root, candidate, out: done)
    code, said = run(package, "flow")
    assert code == 0 and said.splitlines() == [
        f"Wrote {tmp_path}/flow.zip: 2 files, 3.5 MiB.",
        f"Address {index.address}",
        "Gates   A PASS, D FAIL",
        "    1  dataset: 1 files",
        "   10  safety: 2 files; not measured: no probe",
    ]


def test_as_json_nothing_else_is_printed(run, bundle, proved):
    proved("PASS", "PASS", "FAIL", "PASS")
    code, said = run(verify, "bundle", bundle, "--json")
    assert code == 0 and [rung["gate"] for rung in json.loads(said)] == list("ABCD")


def test_an_untrue_report_exits_3(run, bundle, proved):
    proved("PASS", "REFUSED", "PASS", "PASS")
    code, said = run(verify, "bundle", bundle)
    assert code == 3 and "files are what" not in said


def test_what_was_given_is_asked_in_an_empty_folder(run, bundle, proved):
    given = proved("PASS", "PASS", "PASS", "PASS")
    run(verify, "bundle", bundle, "--address", "f" * 32, "--run-programs")
    assert given == {"address": "f" * 32, "run_programs": True, "empty": True}
    run(verify, "bundle", bundle)
    assert given == {"address": "", "run_programs": False, "empty": True}


def test_a_bundle_that_is_none_exits_2(run, tmp_path):
    code, said = run(verify, "bundle", tmp_path / "absent.zip")
    assert code == 2 and "is no file" in said


def test_a_candidate_without_evidence_exits_2(run, whole, tmp_path):
    code, said = run(package, "nobody", "--out", tmp_path / "x.zip", "--root", whole)
    assert code == 2 and "eleven groups" in said
