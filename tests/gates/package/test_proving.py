"""What is asked of a bundle before anything is judged; real bundles are proved in tests/ladder."""

import json
import shutil

import pytest

from gates.package import proving
from gates.package.archive import read_index
from gates.package.bundling import package
from gates.package.proving import prove_bundle
from genpolicy.errors import BadInputError, ConfigError, IntegrityError


@pytest.fixture
def bundle(whole, tmp_path):
    package(whole, "flow", tmp_path / "flow.zip")
    return tmp_path / "flow.zip"


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
