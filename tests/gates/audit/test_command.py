"""`genpolicy audit`: whole or nothing, never over the recordings, going on where it was."""

import shutil
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from planar import planar

from gates.audit import command, importing
from gates.cause import Answer, Cause, CauseName, Topic, cause_of, default_limits
from genpolicy.cli.main import main
from genpolicy.cli.resume import work_folder
from genpolicy.cli.task_checks import task_checks
from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats.contract import load_contract
from genpolicy.integrity.documents import read_json
from genpolicy.pages.audit.words import TITLES

sys.path.insert(0, str(Path(__file__).parents[2] / "audit"))


ROOT = Path(__file__).parents[3]


OUTPUTS = {"audit.json", "audit.html", "contract.yaml", "evidence", "dataset"}


@pytest.fixture(scope="module")
def table():
    data, _ = planar(episodes=60)
    episode = data.episode
    return pa.table(
        {
            "episode_index": episode, "frame_index": data.index, "timestamp": data.event_time_s,
            "tcp_x_m": data.observation[:, 0], "tcp_y_m": data.observation[:, 1],
            "action_x_m": data.action[:, 0], "action_y_m": data.action[:, 1],
            "operator": pa.array(data.episodes.operator[episode].tolist()),
            "outcome": pa.array(data.episodes.outcome[episode].tolist()),
        }
    )  # fmt: skip


@pytest.fixture
def recordings(table, tmp_path):
    path = tmp_path / "recordings" / "planar.parquet"
    path.parent.mkdir()
    pq.write_table(table, path)
    return path


def run(path, out, *more):
    return main(["audit", str(path), "--out", str(out), *more])


def files(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture
def unaudited(monkeypatch):
    """The audit is never reached: what is refused before it must not cost it."""
    monkeypatch.setattr(command, "audit", lambda *_, **__: pytest.fail("the audit began"))


ROW = Answer("q", Topic.DATA, "an offset", 0.05, 0.0123456)
OTHER = Answer("o", Topic.LABELS, "labels", None, None)
CAUSE = Cause(
    CauseName.DATA_DEFECT, "the_robot", "clock", Topic.DATA, "Correct it.", (ROW, OTHER), 0.5,
    (3, 4), ("Modes.", "More."),
)  # fmt: skip


def told(cause=CAUSE, refused=0, out=Path("out")):
    report = SimpleNamespace(evidence=("from e1", "from e2"), rests_on=("60 episodes",))
    opened = SimpleNamespace(refused=[SimpleNamespace(reason=f"r{k}") for k in range(refused)])
    return command.as_text(report, cause, opened, out).splitlines()


def test_golden_what_a_person_reads_at_the_terminal():
    title = TITLES[CauseName.DATA_DEFECT]
    assert told() == [
        "verdict     data_defect (the robot, clock)",
        f"            {title}; 3 of 4 resampled audits say the same; first red topic: data",
        "found       Modes.",
        "            More.",
        "judged      an offset: 0.05, <= 0.0123, red",
        "evidence    from e1",
        "            from e2",
        "rests on    60 episodes",
        "next        Correct it.",
        "page        out/audit.html",
    ]


def test_what_is_said_where_nothing_is_red_or_sure():
    alike = replace(CAUSE, variable="clock", agreeing=(0, 0), topic=Topic.NONE)
    verdict, sure, *_ = told(alike)
    assert verdict == "verdict     data_defect (clock)"
    assert sure.endswith("; confidence unknown; no topic is red")
    assert told(replace(CAUSE, variable="", kind=""))[0] == "verdict     data_defect"
    against = told(replace(CAUSE, topic=Topic.AGREEMENT))[1]
    assert against.endswith("3 of 4 resampled audits contradict what all of them say; first red "
                            "topic: agreement")  # fmt: skip
    labels = told(replace(CAUSE, topic=Topic.LABELS))
    assert "judged      labels: unknown, no limit" in labels
    held = replace(CAUSE, answers=(replace(ROW, measured=0.01),))
    assert "judged      an offset: 0.01, <= 0.0123" in told(held)


@pytest.mark.parametrize("refused", [0, 1, 5, 6, 9])
def test_five_refusals_are_told_and_how_many_more_there_are(refused):
    lines = told(refused=refused)[-1 - min(refused, 6) : -1]
    shown = [f"r{k}" for k in range(min(refused, 5))]
    more = [f"and {refused - 5} more"] if refused > 5 else []
    assert [line[12:] for line in lines] == shown + more
    assert [line[:12].strip() for line in lines] == ["refused", *[""] * 5][: len(lines)]


@pytest.mark.parametrize(
    ("tasks", "name"),
    [(["insert"], "insert"), (["unnamed"], "data"), ([], "data"), (["a", "b"], "data")],
)
def test_a_dataset_is_called_by_its_one_task_or_by_its_file(tasks, name, tmp_path):
    dataset = SimpleNamespace(manifest={"tasks": tasks})
    assert command.name_of(dataset, tmp_path / "data") == name


def test_everything_is_written_and_again_the_same(recordings, tmp_path, capsys):
    out = tmp_path / "audit"
    assert run(recordings, out) == 0
    printed = capsys.readouterr()
    assert {path.name for path in out.iterdir()} == OUTPUTS
    document = read_json(out / "audit.json")
    for name in ("verdict", "variable", "kind", "confidence", "modes", "support", "evidence",
                 "next_action", "rests_on"):  # fmt: skip
        assert name in document
    assert f"verdict     {document['verdict']}" in printed.out
    assert document["next_action"] in printed.out and str(out / "audit.html") in printed.out
    assert all(line in printed.out for line in document["rests_on"])
    assert "60 episodes accepted, 0 refused" in printed.err
    assert "packaged; --limits gives others" in printed.out
    limits = default_limits()
    assert document["limits"] == limits.as_json()
    assert all(f"{name} {item.limit:g}" in printed.out for name, item in limits.by_question.items())
    cause = cause_of(out / "evidence", limits)
    assert document["questions"] == [answer.as_json() for answer in cause.answers]
    assert (document["verdict"], document["confidence"]) == (cause.name.value, cause.confidence)
    assert load_dataset(out / "dataset").manifest_sha256 == document["dataset_manifest_sha256"]
    assert not work_folder(out).exists()
    page = (out / "audit.html").read_text()
    for uuid in load_dataset(out / "dataset").episodes["episode_uuid"]:
        assert uuid not in printed.out and uuid not in page and f"{uuid[:8]}, row" not in page
    assert document["episodes"]  # of the situations that are drawn
    for name in document["episodes"].values():
        assert name.startswith("planar.parquet#episode_") and name.split("#")[1] in page
    first = files(out)

    contract = tmp_path / "contract.yaml"
    shutil.copyfile(out / "contract.yaml", contract)
    load_contract(contract)
    assert run(recordings, out, "--contract", str(contract)) == 0
    assert files(out) == first

    again = tmp_path / "of-the-dataset"
    shutil.copytree(out / "dataset", tmp_path / "dataset")
    assert run(tmp_path / "dataset", again) == 0
    assert {path.name for path in again.iterdir()} == OUTPUTS - {"dataset"}
    assert read_json(again / "audit.json")["verdict"] == document["verdict"]


def test_limits_say_where_they_are_from(tmp_path):
    limits, own = default_limits(), tmp_path / "params.yaml"
    assert "packaged" in command.limits_text(limits, None)
    assert str(own) in command.limits_text(limits, own)


@pytest.mark.usefixtures("unaudited")
def test_limits_that_are_none_are_refused_before_the_audit(recordings, tmp_path, capsys):
    params = yaml.safe_load((ROOT / "params.yaml").read_text())
    del params["gate_a"]["limits"]["perception"]["clock_residual_s"]
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(params))
    assert run(recordings, tmp_path / "a", "--limits", str(tmp_path / "params.yaml")) == 2
    assert "clock_residual_s is missing" in capsys.readouterr().err


@pytest.mark.usefixtures("unaudited")
@pytest.mark.parametrize("place", [".", "recordings", "recordings/audit"])
def test_recordings_are_never_written_over(recordings, tmp_path, place, capsys):
    before = files(tmp_path)
    assert run(recordings.parent, tmp_path / place) == 2
    assert "never written to" in capsys.readouterr().err
    assert files(tmp_path) == before


@pytest.mark.usefixtures("unaudited")
def test_a_folder_that_is_no_audit_is_not_replaced(recordings, tmp_path, capsys):
    out = tmp_path / "precious"
    out.mkdir()
    (out / "thesis.tex").write_text("years")
    assert run(recordings, out) == 2
    assert "nothing was removed" in capsys.readouterr().err
    assert (out / "thesis.tex").read_text() == "years"
    (tmp_path / "link").symlink_to(tmp_path / "recordings")
    assert run(recordings, tmp_path / "link") == 2
    (tmp_path / "file").write_text("x")
    assert run(recordings, tmp_path / "file") == 2
    assert (tmp_path / "file").read_text() == "x"


@pytest.mark.usefixtures("unaudited")
def test_bad_input_leaves_nothing(tmp_path, capsys):
    assert run(tmp_path / "nowhere", tmp_path / "out") == 2
    (tmp_path / "broken.parquet").write_bytes(b"PAR1")
    assert run(tmp_path / "broken.parquet", tmp_path / "out") == 2
    error = capsys.readouterr().err
    assert "Traceback" not in error
    assert [path.name for path in tmp_path.iterdir()] == ["broken.parquet"]


def interrupt(*_, **__):
    raise KeyboardInterrupt


def test_an_interrupted_audit_goes_on_without_importing_again(
    recordings, tmp_path, monkeypatch, capsys
):
    out = tmp_path / "audit"
    with monkeypatch.context() as patched:
        patched.setattr(command, "audit", interrupt)
        assert run(recordings, out) == 130
    assert not out.exists() and (work_folder(out) / "dataset").is_dir()
    with monkeypatch.context() as patched:
        patched.setattr(importing, "open_dataset", lambda *_, **__: pytest.fail("imported again"))
        assert run(recordings, out) == 0
    assert {path.name for path in out.iterdir()} == OUTPUTS
    assert not work_folder(out).exists()


def test_other_recordings_are_imported_anew(recordings, table, tmp_path, monkeypatch, capsys):
    out = tmp_path / "audit"
    monkeypatch.setattr(command, "audit", interrupt)
    assert run(recordings, out) == 130
    kept = load_dataset(work_folder(out) / "dataset")
    pq.write_table(table.filter(pa.compute.less(table["episode_index"], 50)), recordings)
    assert run(recordings, out) == 130
    new = load_dataset(work_folder(out) / "dataset")
    assert len(kept.episodes) == 60 and len(new.episodes) == 50
    # A kept dataset that was changed is not believed.
    (work_folder(out) / "dataset" / "frames.parquet").write_bytes(b"PAR1")
    assert run(recordings, out) == 130
    assert len(load_dataset(work_folder(out) / "dataset").episodes) == 50


def test_a_failure_while_writing_leaves_no_half_audit(recordings, tmp_path, monkeypatch):
    out = tmp_path / "audit"
    monkeypatch.setattr(command, "audit_page", interrupt)
    assert run(recordings, out) == 130
    assert not out.exists()
    assert (work_folder(out) / "dataset" / "manifest.json").is_file()


def test_only_the_task_of_the_data_checks_them(recordings, tmp_path, monkeypatch):
    out = tmp_path / "audit"
    monkeypatch.setattr(command, "audit", interrupt)
    run(recordings, out)
    dataset = load_dataset(work_folder(out) / "dataset")
    for name in (None, "no such task", "tabletop_insertion"):
        checks = task_checks(dataset, task=name, chunk_rows=16)
        assert checks.admissible is None and checks.replay is None and checks.obstacles == []
