"""Reports of another run: in a folder, in a checkout, in a commit; anything else is bad input."""

import subprocess

import pytest
from test_differences import REPORT

from gates.past import reports_of
from gates.report import SCHEMA_VERSION, report_bytes
from genpolicy.errors import BadInputError, IntegrityError

GOOD = REPORT.model_copy(update={"schema_version": SCHEMA_VERSION})


@pytest.fixture
def checkout(tmp_path):
    """One commit with a report that says PASS, and one that says FAIL lies there."""
    reports = tmp_path / "reports"
    reports.mkdir()
    (reports / "gate_a.json").write_bytes(report_bytes(GOOD))
    git = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b.example"]
    for words in (["init", "-q"], ["add", "-A"], ["commit", "-qm", "one"]):
        subprocess.run([*git, *words], check=True)
    (reports / "gate_a.json").write_bytes(report_bytes(GOOD.model_copy(update={"verdict": "FAIL"})))
    return tmp_path


def test_a_checkout_its_folder_and_its_commit(checkout):
    for place in (checkout, checkout / "reports"):
        assert reports_of(str(place), checkout)["A"].verdict == "FAIL"
    found = reports_of("HEAD", checkout)
    assert list(found) == ["A"] and found["A"] == GOOD


def test_a_revision_is_read_from_the_root_that_is_named(checkout):
    """A ladder may lie below the root of its repository: its reports are meant, not those above."""
    with pytest.raises(BadInputError):
        reports_of("HEAD", checkout / "reports")


@pytest.mark.parametrize("place", ["HEAD~7", "nowhere", "--output=x"])
def test_what_is_neither_folder_nor_revision_is_named(checkout, place):
    with pytest.raises(BadInputError, match="no folder and no revision"):
        reports_of(place, checkout)
    assert not (checkout / "x").exists()


def test_a_revision_without_reports_is_one(checkout):
    """A branch that a ladder is brought into for the first time exists, and has none."""
    git = ["git", "-C", str(checkout), "-c", "user.name=a", "-c", "user.email=a@b.example"]
    subprocess.run([*git, "checkout", "-q", "--orphan", "bare"], check=True)
    subprocess.run([*git, "commit", "-qm", "none", "--allow-empty"], check=True)
    subprocess.run([*git, "rm", "-qr", "--cached", "."], check=True)
    subprocess.run([*git, "commit", "-qm", "none", "--allow-empty"], check=True)
    with pytest.raises(BadInputError, match="bare is without a report of a gate"):
        reports_of("bare", checkout)


def test_a_folder_without_reports_is_named(checkout):
    (checkout / "empty").mkdir()
    with pytest.raises(BadInputError, match="without a report of a gate"):
        reports_of(str(checkout / "empty"), checkout)


def test_a_report_that_cannot_be_read_is_not_left_out(checkout):
    (checkout / "reports" / "gate_b.json").write_text("{")
    with pytest.raises(IntegrityError, match="gate_b"):
        reports_of(str(checkout), checkout)
