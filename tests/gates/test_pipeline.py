"""The record of the pipeline: nothing is judged or proved that its stage did not write."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import evidence
import pytest
import yaml

from gates import pipeline
from gates.proof import admit, judge, prove_all
from gates.report import report_bytes, report_path
from genpolicy.errors import ConfigError, IntegrityError, RefusedError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.hashing import sha256_file
from genpolicy.integrity.tables import read_table, write_table

ROLLOUTS = "artifacts/stress/rollouts.parquet"


def _judge_again(root, gates):
    for gate in gates:
        write_bytes(root / report_path(gate), report_bytes(judge(root, gate)))


def _forge(root):
    """A table in which every candidate succeeds, put in the place of the measured one."""
    table = read_table(root / ROLLOUTS)
    place = table.schema.get_field_index("success")
    write_table(
        root / ROLLOUTS,
        table.set_column(place, table.schema.field(place), [[True] * table.num_rows]),
    )


def test_every_file_of_every_evidence_stage_is_bound(ladder):
    bound = set()
    for gate in "ABCDE":
        bound |= set(judge(ladder, gate).materials)
    stages = [stage for names in pipeline.RUNGS.values() for stage in names]
    folders = [f"artifacts/{stage}" for stage in stages]
    assert set(folders) == {
        path.relative_to(ladder).as_posix()
        for path in (ladder / "artifacts").iterdir()
        if path.is_dir() and not path.name.startswith("gate_")
    } | {"artifacts/record", "artifacts/failure_search"}, "nobody asked for a search here"
    lying = {
        path.relative_to(ladder).as_posix()
        for folder in folders
        for path in (ladder / folder).rglob("*")
        if path.is_file()
    }
    assert lying and lying <= bound


def test_what_monitors_writes_is_bound_and_its_own(ladder):
    """The probes' scores, rollouts, journals: the report names each, and nobody adds one."""
    own = {
        path.relative_to(ladder).as_posix()
        for path in (ladder / "artifacts/monitors").rglob("*")
        if path.is_file()
    }
    assert {f"artifacts/monitors/{name}.parquet" for name in ("scores", "unavailable")} < own
    assert own <= set(judge(ladder, "D").materials)
    (ladder / "artifacts/monitors/notes.txt").write_text("all fine")
    judged = r"monitors/notes\.txt is a file that nobody judged.*Run `dvc repro monitors` and judge"
    with pytest.raises(RefusedError, match=judged):
        admit("card", ladder)
    wrote = r"artifacts/monitors is other than recorded.*what `monitors` wrote by dvc\.lock"
    with pytest.raises(IntegrityError, match=wrote):
        judge(ladder, "D")
    (ladder / "artifacts/monitors/notes.txt").unlink()
    (ladder / "artifacts/monitors/scores.parquet").write_bytes(b"other")
    with pytest.raises(RefusedError, match=r"monitors/scores\.parquet.*Run `dvc repro monitors`"):
        admit("card", ladder)


def test_forged_evidence_is_refused_when_it_is_judged(ladder):
    _forge(ladder)
    with pytest.raises(
        IntegrityError, match=r"artifacts/stress is other than recorded \(md5 [0-9a-f]{12}…\)"
    ):
        judge(ladder, "D")


def test_a_file_added_to_the_evidence_is_refused_by_its_name(ladder):
    (ladder / "artifacts/shadow/notes.txt").write_text("all fine")
    judged = r"shadow/notes\.txt is a file that nobody judged.*Run `dvc repro shadow` and judge"
    with pytest.raises(RefusedError, match=judged):
        admit("stress", ladder)
    with pytest.raises(IntegrityError, match="artifacts/shadow"):
        judge(ladder, "C")


def test_other_code_refuses_below_and_above(ladder):
    """The stiffness of the controller, changed after everything passed."""
    (ladder / evidence.CODE).write_text("STIFFNESS = 2\n")
    with pytest.raises(RefusedError, match="Gate A refuses: code of genpolicy/robot is"):
        admit("card", ladder)
    with pytest.raises(IntegrityError, match=r"impedance\.py is other than recorded"):
        judge(ladder, "D")
    assert [rung.verdict for rung in prove_all(ladder)][:4] == ["REFUSED"] * 4


def test_other_parameters_of_the_evidence_refuse(ladder):
    params = yaml.safe_load((ladder / "params.yaml").read_text())
    params["stress"]["margin"] = 0.001
    (ladder / "params.yaml").write_text(yaml.safe_dump(params, sort_keys=False))
    with pytest.raises(RefusedError, match="Gate D refuses: parameters of stress is"):
        admit("card", ladder)
    with pytest.raises(IntegrityError, match=r"params\.yaml: stress is other than recorded"):
        judge(ladder, "D")


def test_evidence_measured_again_needs_a_judgement(ladder):
    _forge(ladder)
    evidence.record(ladder)
    with pytest.raises(RefusedError, match="Gate D refuses"):
        admit("card", ladder)
    lock = yaml.safe_load((ladder / "dvc.lock").read_text())
    lock["stages"]["audit"]["cmd"] = "python -m other"
    (ladder / "dvc.lock").write_text(json.dumps(lock))
    with pytest.raises(RefusedError, match="Gate A refuses: the recorded run of audit"):
        admit("card", ladder)


@pytest.mark.parametrize("name", ["dvc.lock", "dvc.yaml"])
def test_nothing_passes_outside_a_recorded_pipeline(ladder, name):
    (ladder / name).unlink()
    for gate in "ABCD":
        report = judge(ladder, gate)
        assert report.verdict == "INCONCLUSIVE"
        assert any("dvc.lock holds no run of" in caveat for caveat in report.caveats)
        assert all(answer.verdict == "PASS" for answer in report.criteria)


def test_one_stage_without_a_record_is_enough(ladder):
    lock = yaml.safe_load((ladder / "dvc.lock").read_text())
    del lock["stages"]["latency"]
    (ladder / "dvc.lock").write_text(json.dumps(lock))
    report = judge(ladder, "B")
    assert report.verdict == "INCONCLUSIVE"
    assert report.caveats[-1].endswith("no run of latency.")
    assert judge(ladder, "A").verdict == "PASS"


def test_a_task_whose_package_has_changed_refuses(ladder):
    package = ladder / "some_task"
    package.mkdir()
    (package / "task.py").write_text("TASK = 1\n")
    (package / "scene.xml").write_text("<mujoco/>")
    files = {name: sha256_file(package / name) for name in ("scene.xml", "task.py")}
    identity = {"name": "t", "entry_point": "some_task.task:TASK", "package": files}
    evidence.edit_document(ladder, "task/identity.json", lambda d: d.update(identity))
    assert judge(ladder, "A").verdict == "PASS"
    (package / "scene.xml").write_text("<mujoco></mujoco>")
    with pytest.raises(IntegrityError, match=r"the task t: scene\.xml is other than"):
        judge(ladder, "A")
    (package / "scene.xml").unlink()
    with pytest.raises(IntegrityError, match=r"the task t: scene\.xml is other than"):
        judge(ladder, "A")


def test_an_identity_without_an_entry_point_names_no_file(ladder, monkeypatch):
    """In the folder itself, as `dvc repro` runs it, the empty name was a fault of genpolicy."""
    monkeypatch.chdir(ladder)
    assert judge(Path(), "A").verdict == "PASS"
    evidence.edit_document(Path(), "task/identity.json", lambda d: d | {"package": {"a.py": "0"}})
    with pytest.raises(IntegrityError, match=r"the task .*: a\.py is other than"):
        judge(Path(), "A")


def test_a_report_about_another_task_refuses(ladder):
    identity = {"name": "t", "entry_point": "no_task:TASK", "package": {"task.py": "0" * 64}}
    _judge_again(ladder, "A")
    evidence.edit_document(ladder, "task/identity.json", lambda _: identity)
    with pytest.raises(RefusedError):
        admit("train_generators", ladder)


def test_a_printed_page_that_was_changed_refuses(ladder):
    page = ladder / "reports/gate_a.html"
    page.write_text("<p>FAIL</p>")
    lock = yaml.safe_load((ladder / "dvc.lock").read_text())
    md5 = pipeline.Disk(ladder, {}).md5("reports/gate_a.html")
    lock["stages"]["gate_a"] = {"outs": [{"path": "reports/gate_a.html", "md5": md5}]}
    (ladder / "dvc.lock").write_text(json.dumps(lock))
    admit("train_generators", ladder)
    page.write_text("<p>PASS</p>")
    with pytest.raises(RefusedError, match=r"reports/gate_a\.html is another page"):
        admit("train_generators", ladder)
    page.unlink()
    with pytest.raises(RefusedError, match=r"reports/gate_a\.html is another page"):
        admit("train_generators", ladder)


@pytest.mark.parametrize("text", ["stages: [1]", "stages: {", "a: 1\na: 2"])
def test_a_malformed_record_is_a_bad_setting(ladder, text):
    (ladder / "dvc.lock").write_text(text)
    with pytest.raises(ConfigError, match=r"dvc\.lock"):
        judge(ladder, "D")


@pytest.fixture(scope="module")
def _real(tmp_path_factory) -> Path:
    """A pipeline of one stage, run by DVC itself."""
    root = tmp_path_factory.mktemp("real")
    subprocess.run([sys.executable, "-m", "dvc", "init", "--no-scm", "-q"], cwd=root, check=True)
    (root / ".dvcignore").write_text("__pycache__\n*.pyc\n")
    for name in ("genpolicy/deep/b.py", "genpolicy/a.py", "genpolicy/__pycache__/a.pyc"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(name)
    (root / "params.yaml").write_text(
        "shadow:\n  small: 0.00001\n  list: [1, 2.5, true, null]\n  text: '1e-05'\nother: {x: 1}\n"
    )
    command = "mkdir -p artifacts/shadow/a && echo 1 > artifacts/shadow/a/x && "
    command += "echo 2 > artifacts/shadow/a.txt"
    stage = {
        "cmd": command,
        "deps": ["genpolicy"],
        "params": ["shadow", "other.x"],
        "outs": ["artifacts/shadow"],
    }
    # What a gate sees of the lock while it judges, in the same `dvc repro` as its evidence.
    gate = {
        "cmd": "cp dvc.lock seen.lock",
        "deps": ["artifacts/shadow"],
        "outs": [{"seen.lock": {"cache": False}}],
    }
    pipeline_of = {"stages": {"shadow": stage, "gate_c": gate}}
    (root / "dvc.yaml").write_text(yaml.safe_dump(pipeline_of))
    subprocess.run([sys.executable, "-m", "dvc", "repro", "-q"], cwd=root, check=True)
    return root


WRONG = {
    "code": ("genpolicy/deep/b.py", "other", r"genpolicy is other than recorded"),
    "new code": ("genpolicy/c.py", "new", r"genpolicy is other than recorded"),
    "evidence": ("artifacts/shadow/a/x", "3\n", r"artifacts/shadow is other than recorded"),
    "small number": (
        "params.yaml",
        "shadow:\n  small: 0.00002\n  list: [1, 2.5, true, null]\n  text: '1e-05'\nother: {x: 1}",
        r"params\.yaml: shadow is other",
    ),
    "nested number": (
        "params.yaml",
        "shadow:\n  small: 0.00001\n  list: [1, 2.5, true, null]\n  text: '1e-05'\nother: {x: 2}",
        r"params\.yaml: other\.x is other",
    ),
}


def test_a_gate_finds_the_run_of_its_evidence_and_not_its_own(_real):
    seen = yaml.safe_load((_real / "seen.lock").read_text())["stages"]
    assert set(seen) == {"shadow"}
    assert seen["shadow"] == yaml.safe_load((_real / "dvc.lock").read_text())["stages"]["shadow"]


def test_the_record_is_read_as_dvc_writes_it(_real):
    """Folders, nested folders, ignored files, nested parameters and small numbers."""
    pipeline.check_record(_real, "C", {})
    assert pipeline.basis_of(_real, "C").unrecorded == ()
    assert pipeline.outputs_of(_real, "C") == ("artifacts/shadow/a.txt", "artifacts/shadow/a/x")
    (_real / "genpolicy/__pycache__/b.pyc").write_text("compiled again")
    pipeline.check_record(_real, "C", {})


@pytest.mark.parametrize("name", WRONG)
def test_what_is_not_as_dvc_recorded_it_is_refused(_real, name):
    file, text, sentence = WRONG[name]
    path = _real / file
    before = path.read_text() if path.exists() else None
    path.write_text(text)
    try:
        with pytest.raises(IntegrityError, match=sentence):
            pipeline.check_record(_real, "C", {})
    finally:
        path.unlink() if before is None else path.write_text(before)


def test_bytes_that_change_while_they_are_judged_are_refused(_real):
    with pytest.raises(IntegrityError, match="changed while it was judged"):
        pipeline.check_record(_real, "C", {"artifacts/shadow/a.txt": "0" * 64})


def test_an_output_that_is_missing_is_no_output_as_recorded(ladder):
    shutil.rmtree(ladder / "artifacts/latency")
    with pytest.raises(IntegrityError, match="artifacts/latency is missing"):
        pipeline.check_record(ladder, "B", {})


def _lock(root, change):
    lock = yaml.safe_load((root / "dvc.lock").read_text())
    change(lock["stages"])
    (root / "dvc.lock").write_text(json.dumps(lock))


@pytest.mark.parametrize("file", ["dvc.lock", "dvc.yaml"])
def test_a_stage_without_a_record_hides_no_other_stage(ladder, file):
    """The first of Gate A's has none; what a later one wrote is still held to its record."""
    document = yaml.safe_load((ladder / file).read_text())
    del document["stages"]["task"]
    (ladder / file).write_text(json.dumps(document))
    pipeline.check_record(ladder, "A", {})
    (ladder / "artifacts/audit/summary.json").write_text("{}")
    with pytest.raises(IntegrityError, match="artifacts/audit is other than recorded"):
        pipeline.check_record(ladder, "A", {})


def test_code_is_bound_wherever_it_stands_among_what_a_stage_reads(ladder):
    """Data before it and after it in the list."""
    document = json.loads((ladder / "dvc.yaml").read_text())
    document["stages"]["stress"]["deps"] = ["params.yaml", evidence.CODE, "artifacts/ingest"]
    document["stages"]["gate_d"]["deps"] = []
    (ladder / "dvc.yaml").write_text(json.dumps(document))
    before = pipeline.basis_of(ladder, "D").code
    assert set(before) == {"genpolicy/robot"}
    (ladder / evidence.CODE).write_text("STIFFNESS = 3\n")
    assert pipeline.basis_of(ladder, "D").code != before


def test_what_a_stage_reads_and_its_record_does_not_name_refuses(ladder):
    _lock(ladder, lambda stages: stages["stress"].update(deps=[]))
    with pytest.raises(IntegrityError, match=r"dvc\.lock: stress\.deps is without or beyond"):
        pipeline.check_record(ladder, "D", {})


def test_a_parameter_that_the_record_does_not_name_refuses(ladder):
    _lock(ladder, lambda stages: stages["stress"].update(params={}))
    with pytest.raises(IntegrityError, match=r"params\.yaml: stress is other than recorded"):
        pipeline.check_record(ladder, "D", {})


def test_every_printed_page_is_held_to_its_record_and_nothing_else_is(ladder):
    for name in ("gate_a.html", "gate_a.md"):
        (ladder / "reports" / name).write_text("FAIL")
    md5 = pipeline.Disk(ladder, {}).md5("reports/gate_a.md")
    outs = [
        {"path": "artifacts/other", "md5": "0"},
        {"path": "reports/gate_a.json", "md5": "0"},
        {"path": "reports/gate_a.html", "md5": md5},
        {"path": "reports/gate_a.md", "md5": md5},
    ]
    _lock(ladder, lambda stages: stages.update(gate_a={"outs": outs}))
    assert pipeline.changed_pages(ladder, "A") == ""
    (ladder / "reports/gate_a.md").write_text("PASS")
    assert pipeline.changed_pages(ladder, "A") == "reports/gate_a.md"


def test_rows_beside_a_page_are_held_to_their_record(ladder):
    """A folder: another byte, a file more and a file less are each another folder."""
    rows = ladder / "reports/gate_a"
    rows.mkdir()
    (rows / "criteria.csv").write_text("criterion\n")
    outs = [{"path": "reports/gate_a", "md5": pipeline.Disk(ladder, {}).md5("reports/gate_a")}]
    _lock(ladder, lambda stages: stages.update(gate_a={"outs": outs}))
    assert pipeline.changed_pages(ladder, "A") == ""
    (rows / "more.csv").write_text("row\n")
    assert pipeline.changed_pages(ladder, "A") == "reports/gate_a"
    (rows / "more.csv").unlink()
    (rows / "criteria.csv").write_text("criterion,candidate\n")
    assert pipeline.changed_pages(ladder, "A") == "reports/gate_a"
    (rows / "criteria.csv").unlink()
    assert pipeline.changed_pages(ladder, "A") == "reports/gate_a"


@pytest.mark.parametrize(
    ("recorded", "now", "same"),
    [
        (1, 1.0, True),
        ("1e-05", 1e-05, True),
        ("1e-05", 2e-05, False),
        ("text", 1.0, False),
        ("1.0", "1.0", True),
        (1, True, False),
        (True, 1, False),
        (True, True, True),
        (0, False, False),
        ([1, 2], [1], False),
        ([1], [1, 2], False),
        ([1, 2], [1, 3], False),
        ([1, {"a": "1e-05"}], [1, {"a": 1e-05}], True),
        ({"a": 1}, {"a": 1, "b": 2}, False),
        ({"a": 1}, {"b": 1}, False),
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}, True),
        ({"a": 1, "b": 2}, {"a": 1, "b": 3}, False),
        ([1], {"a": 1}, False),
        ({}, [], False),
        ([], {}, False),
        ({"a": 1}, ["a"], False),
        ([], "", False),
        (None, 0, False),
    ],
)
def test_two_values_are_the_same_setting(recorded, now, same):
    assert pipeline._equal(recorded, now) is same


def test_a_task_of_a_single_file_is_that_file_and_not_its_neighbours(tmp_path, ladder, monkeypatch):
    folder = tmp_path / "site"
    folder.mkdir()
    (folder / "lone_task_of_one_file.py").write_text("TASK = 1\n")
    (folder / "neighbour.py").write_text("")
    monkeypatch.syspath_prepend(str(folder))
    found = pipeline._package(ladder, "lone_task_of_one_file:TASK")
    assert found == {"lone_task_of_one_file.py": sha256_file(folder / "lone_task_of_one_file.py")}
    assert pipeline._package(ladder, "no_such_task_anywhere:TASK") == {}
    assert pipeline._package(ladder, "") == {}
