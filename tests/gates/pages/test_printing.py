"""What is printed beside a report: whole, the same again, and any other byte is named."""

import json
import shutil

import pytest

from gates import rederive
from gates.pages.printing import differing, printed_beside
from gates.pipeline import Disk, changed_pages
from gates.proof import Rung
from gates.report import report_path
from gates.writing import changed_page, write_gate

ROWS = "reports/gate_d/stress.rollouts.flow.csv"


@pytest.fixture(scope="module")
def printed(tmp_path_factory, whole):
    root = tmp_path_factory.mktemp("printed") / "repo"
    shutil.copytree(whole, root)
    return root, write_gate(root, "D")


@pytest.fixture
def again(printed, tmp_path):
    root, report = printed
    shutil.copytree(root, tmp_path / "repo")
    return tmp_path / "repo", report


def test_all_of_it_lies_there_and_nothing_else(printed):
    root, report = printed
    expected = printed_beside(root, report)
    assert {name: (root / name).read_bytes() for name in expected} == expected
    lying = {path.relative_to(root).as_posix() for path in (root / "reports").rglob("*.*")}
    own = {name for name in lying if name.startswith("reports/gate_d")}
    assert own == {*expected, report_path("D")}
    assert ROWS in expected and "reports/gate_d/criteria.csv" in expected
    assert differing(root, report) == changed_page(root) == ""


def _turned(value):
    """The same with the keys of every map in the other order."""
    if not isinstance(value, dict):
        return value
    return {key: _turned(value[key]) for key in reversed(value)}


def test_the_order_in_which_somebody_wrote_settings_moves_no_page(printed):
    """Of a report that was judged just now it is theirs, of one that was read the alphabet's."""
    root, report = printed
    turned = report.model_copy(update={"settings": _turned(report.settings)})
    assert list(turned.settings) != list(report.settings)
    assert printed_beside(root, turned) == printed_beside(root, report)


def test_a_folder_of_an_earlier_run_leaves_nothing_behind(again):
    root, _ = again
    (root / "reports/gate_d/old.csv").write_text("row\n")
    write_gate(root, "D")
    assert not (root / "reports/gate_d/old.csv").exists()


def _other_number(path):
    path.write_bytes(path.read_bytes().replace(b"true", b"frue", 1))


@pytest.mark.parametrize(
    "change",
    [_other_number, lambda path: path.unlink(), lambda path: path.write_bytes(b"")],
    ids=["a cell", "missing", "empty"],
)
def test_another_file_of_rows_is_named(again, change):
    root, report = again
    change(root / ROWS)
    assert differing(root, report) == changed_page(root) == ROWS


def test_a_file_of_rows_that_no_report_gives_is_named(again):
    root, report = again
    (root / "reports/gate_d/more.csv").write_text("row\n")
    assert differing(root, report) == changed_page(root) == "reports/gate_d/more.csv"


def test_what_was_never_printed_counts_in_a_bundle_only(again):
    root, report = again
    shutil.rmtree(root / "reports/gate_d")
    assert changed_page(root) == "" and differing(root, report) == "reports/gate_d/criteria.csv"
    (root / "reports/gate_d.md").unlink()
    assert changed_page(root) == "" and differing(root, report) == "reports/gate_d.md"


def test_what_a_record_holds_is_left_to_it(again):
    root, report = again
    _other_number(root / ROWS)
    folder = frozenset({"reports/gate_d"})
    assert differing(root, report, recorded=folder) == ""
    (root / "reports/gate_d.md").write_text("other")
    assert differing(root, report, recorded=folder) == "reports/gate_d.md"
    pages = {"reports/gate_d.md", "reports/gate_d.html"}
    assert differing(root, report, recorded=folder | pages) == ""
    assert differing(root, report, recorded=frozenset(pages)) == ROWS


@pytest.mark.parametrize(
    "name", ["reports/gate_d.md", "reports/gate_d.html", "reports/gate_d/criteria.csv"]
)
def test_a_page_that_was_changed_and_recorded_anew_is_refused_where_all_is_derived_again(
    again, monkeypatch, name
):
    """As `dvc commit gate_d` does, so that no record shows it: what is printed is printed again."""
    root, _ = again
    monkeypatch.setattr(rederive, "_evidence", lambda root, gate: None)  # it has no journals
    rung = Rung("D", "stress", "PASS", "", "", report_path("D"), 0)

    def recorded():
        places = ("reports/gate_d.md", "reports/gate_d.html", "reports/gate_d")
        disk = Disk(root, {})
        lock = json.loads((root / "dvc.lock").read_text())
        outs = [{"path": place, "md5": disk.md5(place)} for place in places]
        lock["stages"]["gate_d"] = {"cmd": "gate", "outs": outs}
        (root / "dvc.lock").write_text(json.dumps(lock))

    recorded()
    assert rederive.rederived(root, [rung]) == [rung]
    (root / name).write_bytes((root / name).read_bytes().replace(b"0", b"9", 1))
    recorded()
    assert changed_pages(root, "D") == changed_page(root) == ""
    (refused,) = rederive.rederived(root, [rung])
    assert (refused.verdict, refused.exit_code) == ("REFUSED", 3)
    assert refused.note.startswith(f"Gate D refuses: {name} is another page, required the one that")
    assert "dvc repro -f gate_d" in refused.note
    (root / report_path("D")).unlink()
    assert rederive.rederived(root, [rung]) == [rung], "without a report there is none to compare"
