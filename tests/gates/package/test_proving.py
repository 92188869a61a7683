"""What is asked of a bundle before anything is judged; real bundles are proved in tests/ladder."""

import json
import re
import shutil
import sys
import zipfile
from pathlib import Path
from types import SimpleNamespace

import pytest

from gates.package import proving
from gates.package.archive import INDEX_NAME, blob_name, read_index
from gates.package.bundling import package, require_judged
from gates.package.proving import prove_bundle
from gates.package.statements import statement_path
from gates.report import read_report
from genpolicy.errors import BadInputError, ConfigError, IntegrityError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes


@pytest.fixture(scope="module")
def _bundle(_whole, tmp_path_factory):
    path = tmp_path_factory.mktemp("bundle") / "flow.zip"
    package(_whole, "flow", path)
    return path


@pytest.fixture(scope="module")
def _rungs(_whole):
    return require_judged(_whole)


@pytest.fixture
def bundle(_bundle, tmp_path):
    """Packaged once; a copy to forge."""
    return Path(shutil.copyfile(_bundle, tmp_path / "flow.zip"))


@pytest.fixture
def prove(tmp_path):
    def prove(path, **options):
        (tmp_path / "out").mkdir(exist_ok=True)
        return prove_bundle(path, tmp_path / "out", **options)

    return prove


def test_evidence_of_other_code_is_not_proved_by_this(bundle, prove):
    with pytest.raises(IntegrityError, match="other code than runs here"):
        prove(bundle)


@pytest.mark.parametrize("address", ["0" * 64, "short", "wrong"])
def test_the_address_that_was_handed_over_must_be_its_own(bundle, prove, address):
    own = read_index(bundle).address
    given = {"short": own[:31], "wrong": own[:31] + ("0" if own[31] != "0" else "1")}
    with pytest.raises(BadInputError, match="another bundle"):
        prove(bundle, address=given.get(address, address))


def test_what_is_judged_is_what_has_the_address(bundle, prove, monkeypatch):
    """The file may be another one when it is opened a second time."""
    told = read_index(bundle).model_copy(update={"commit": "c" * 40})
    monkeypatch.setattr(proving, "read_index", lambda path: told)
    with pytest.raises(BadInputError, match="another bundle"):
        prove(bundle, address=told.address)


def test_another_address_is_told_before_anything_is_unpacked(bundle, prove, tmp_path):
    with pytest.raises(BadInputError, match="another bundle"):
        prove(bundle, address="0" * 64)
    assert list((tmp_path / "out").iterdir()) == []


def test_its_first_digits_are_enough(bundle, prove):
    with pytest.raises(IntegrityError, match="other code"):
        prove(bundle, address=read_index(bundle).address[:32])


def test_another_task_than_is_installed_is_refused_and_not_imported(whole, monkeypatch):
    looked = []
    monkeypatch.setattr("importlib.util.find_spec", lambda *a: looked.append(a))
    file = whole / "artifacts/task/identity.json"
    stated = json.loads(file.read_bytes())
    file.write_text(json.dumps({**stated, "entry_point": "this:T", "package": {}}))
    monkeypatch.setattr(proving, "task_identity", lambda name: stated)
    with pytest.raises(IntegrityError, match="another task than is installed"):
        proving._require_task(whole)
    assert looked == []


def test_a_task_that_is_not_installed_is_told(whole):
    params = (whole / "params.yaml").read_text()
    assert "name: " in params
    (whole / "params.yaml").write_text("task: {name: nowhere}\n")
    with pytest.raises(ConfigError, match="nowhere"):
        proving._require_task(whole)
    (whole / "params.yaml").write_text("task: {name: 3}\n")
    with pytest.raises(ConfigError, match=r"task\.name is 3"):
        proving._require_task(whole)


def test_other_libraries_are_told_with_what_to_install(whole, monkeypatch):
    monkeypatch.setattr(proving, "environment", lambda: {"numpy": "0.1"})
    with pytest.raises(IntegrityError, match=r"is .*, expected .*constraints\.txt"):
        proving._require_environment(whole)


def test_a_page_that_says_other_than_its_report_is_refused(whole, monkeypatch):
    """So are rows; that each is printed once more and compared is tested where that is done."""
    asked = []
    monkeypatch.setattr(proving, "differing", lambda root, report: asked.append(report.gate) or "")
    proving._require_pages(whole)
    assert asked == list("ABCD")
    rows = "reports/gate_c/shadow.stub.flow.csv"
    monkeypatch.setattr(
        proving, "differing", lambda root, report: rows if report.gate == "C" else ""
    )
    with pytest.raises(IntegrityError, match=r"gate_c/shadow\.stub\.flow\.csv is another page"):
        proving._require_pages(whole)


def test_a_bundle_that_was_never_judged_is_refused_before_it_is_read(tmp_path, prove, bundle):
    shutil.copyfile(bundle, tmp_path / "cut.zip")
    (tmp_path / "cut.zip").write_bytes(bundle.read_bytes()[:100])
    with pytest.raises(IntegrityError, match="whole archive"):
        prove(tmp_path / "cut.zip")
    assert list((tmp_path / "out").iterdir()) == []


@pytest.fixture
def here(whole, _rungs, monkeypatch):
    """Code, task, pages and reports of the bundle are as they are here: its own words are left."""
    stated = json.loads((whole / "artifacts/task/identity.json").read_bytes())
    monkeypatch.setattr(proving, "INSTALLED", whole)
    monkeypatch.setattr(proving, "task_identity", lambda name: stated)
    monkeypatch.setattr(proving, "differing", lambda root, report: "")
    monkeypatch.setattr(proving, "require_judged", lambda folder: _rungs)
    again = SimpleNamespace(rederived=lambda folder, found: found)
    monkeypatch.setitem(sys.modules, "gates.rederive", again)
    return _rungs


def forged(bundle, change):
    """The bundle after a change of its index and entries, which fit each other again."""
    with zipfile.ZipFile(bundle) as whole:
        entries = {name: whole.read(name) for name in whole.namelist()}
    index = json.loads(entries[INDEX_NAME])
    change(index, entries)
    entries[INDEX_NAME] = canonical_json(index)
    with zipfile.ZipFile(bundle, "w") as other:
        for name, data in entries.items():
            other.writestr(name, data)
    return bundle


def test_what_is_as_it_says_is_proved(bundle, prove, here):
    index, rungs = prove(bundle, address=read_index(bundle).address)
    assert index == read_index(bundle) and rungs == here
    assert {rung.gate: rung.verdict for rung in rungs} == index.verdicts


def test_a_verdict_that_the_evidence_does_not_give_is_refused(bundle, prove, here):
    stated = {rung.gate: rung.verdict for rung in here}
    rungs = prove(forged(bundle, lambda index, _: index["verdicts"].update(D="FINE")))[1]
    assert rungs[:3] == here[:3]
    last = rungs[3]
    assert (last.verdict, last.decided_by, last.exit_code) == ("REFUSED", "", 3)
    assert last.note == f"the index says FINE, and the evidence {stated['D']}"


def _statement(index, entries):
    entries[statement_path("C")] = b"{}"
    index["statements"]["C"] = sha256_bytes(b"{}")


def _more(index, entries):
    for name in ("z", "more"):
        index["files"][name] = {"sha256": sha256_bytes(b"x"), "size": 1, "executable": False}
    entries[blob_name(sha256_bytes(b"x"))] = b"x"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda index, _: index.update(checkpoint="0" * 64), "the checkpoint is another than the"),
        (lambda index, _: index.update(candidate="nobody"), "the checkpoint is another than the"),
        (_statement, "statements/gate_c.json is not what the report"),
        (lambda index, _: index["groups"][3].update(title="t"), "the groups is other than the"),
        (_more, "the files is without or beyond more"),
    ],
    ids=["checkpoint", "candidate", "statement", "group", "files"],
)
def test_what_it_says_of_itself_is_made_again(bundle, prove, here, change, said):
    with pytest.raises(IntegrityError, match=re.escape(said)):
        prove(forged(bundle, change))


def test_programs_are_started_by_leave_alone(bundle, prove, here, monkeypatch):
    """One by one: who brought them is told by name."""
    policies = [SimpleNamespace(name="walker"), SimpleNamespace(name="flow")]
    monkeypatch.setattr(proving, "brought", lambda folder: policies)
    with pytest.raises(BadInputError, match="programs of flow, walker, which are asked again"):
        prove(bundle)


def test_leave_to_start_programs_is_enough(bundle, prove, here, monkeypatch):
    monkeypatch.setattr(proving, "brought", lambda folder: [SimpleNamespace(name="walker")])
    assert prove(bundle, run_programs=True)[1] == here


@pytest.mark.parametrize("commit", ["", "c" * 40])
def test_other_code_is_told_by_its_first_file_with_the_commit_that_has_it(
    whole, bundle, tmp_path, monkeypatch, commit
):
    """Of four files one is changed, one is more, one is gone: three are other."""
    index = read_index(bundle).model_copy(update={"commit": commit})
    own = sorted(name for name in index.files if name.startswith(("genpolicy/", "gates/")))
    monkeypatch.setattr(proving, "INSTALLED", whole)
    proving._require_code(index, tmp_path)
    (whole / "stages").mkdir(exist_ok=True)
    for name in ("stages/b.py", "stages/c.py"):
        (whole / name).write_text("")
    (whole / own[-1]).write_text("other")
    at = " of commit cccccccccccc" if commit else ""
    with pytest.raises(IntegrityError) as caught:
        proving._require_code(index, tmp_path)
    said = str(caught.value)
    assert said.startswith(f"{own[-1]} in {tmp_path} is other code than runs here ")
    assert f"(3 of {len(own) + 2} files)" in said
    assert f"Verify with the checkout{at} that the bundle" in said


def test_libraries_are_told_by_the_first_that_differs(whole, monkeypatch):
    """At the first gate whose report is there."""
    there = read_report(whole, "B")[0].environment
    first, second = sorted(there)[:2]
    monkeypatch.setattr(proving, "environment", lambda: {**there, first: "0.1", second: "0.2"})
    (whole / "reports/gate_a.json").unlink()
    said = f"{first} on this machine is 0.1, expected {there[first]}, with which Gate B was judged"
    with pytest.raises(IntegrityError, match=re.escape(said)):
        proving._require_environment(whole)
    monkeypatch.setattr(proving, "environment", lambda: there)
    proving._require_environment(whole)
