"""What the supervisor's process refuses before it begins; the rest is asked of real processes."""

import sys
from types import SimpleNamespace

import pytest
from arranged import request_of, workspace

from genpolicy.errors import ConfigError
from genpolicy.execution.supervisor import SupervisorState
from genpolicy.wall_clock import process as process_module
from genpolicy.wall_clock.limits import read_limits


@pytest.fixture(autouse=True)
def alone(monkeypatch):
    """The tests have loaded policies; a supervisor's process has not."""
    monkeypatch.setattr(process_module.signal, "signal", lambda *_: None)
    monkeypatch.setattr(process_module, "LEARNED", ())


def begun(folder):
    return process_module.main([str(folder), "--answers", "0", "--asks", "1", "--operator", "2"])


@pytest.mark.parametrize("module", process_module.LEARNED)
def test_whatever_learned_is_loaded_is_refused(module, monkeypatch):
    monkeypatch.setattr(process_module, "LEARNED", (module,))
    monkeypatch.setitem(sys.modules, module, object())
    with pytest.raises(ConfigError, match=f"with {module} loaded"):
        process_module._refuse_learned()


def test_a_folder_without_a_request_is_refused(tmp_path, capsys):
    assert begun(tmp_path) == 2
    assert "request.json is not readable" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"force_limit_n": {"approach": 40.0}, "late_chunk": {"hold": ["approach"]},
          "recovery_plans": {}}, "expected the task's"),
        ({"force_limit_n": dict.fromkeys(
            ("approach", "align", "insert", "release", "retreat", "recover"), 1.0)},
         "where the supervisor stops"),
        ({"maximum_age_s": 1.4}, "age of a chunk's last valid action"),
        ({"watchdog_s": 0.01}, "at least one period"),
    ],
)  # fmt: skip
def test_limits_that_are_not_for_this_cell_are_refused(changes, said, tmp_path):
    with pytest.raises(ConfigError, match=said):
        process_module._cell(read_limits(workspace(tmp_path, **changes)))


def test_nothing_is_written_before_it_is_allowed_to_begin(standing, tmp_path, capsys):
    root = workspace(tmp_path)
    (root / "limits.yaml").write_text("task: another\n")
    folder = tmp_path / "run"
    folder.mkdir()
    request_of(root, standing).write(folder)
    assert begun(folder) == 2
    assert "as pinned" in capsys.readouterr().err
    assert sorted(path.name for path in folder.iterdir()) == ["request.json"]


@pytest.mark.parametrize(("state", "played"), [
    (SupervisorState.RUN, 2), (SupervisorState.PROTECTIVE_STOP, 2),
    (SupervisorState.EMERGENCY_STOP, 1),
])  # fmt: skip
def test_behind_an_emergency_stop_no_replay_begins(state, played, tmp_path, monkeypatch):
    """Each replay has a supervisor of its own, and only a person clears an E-stop."""
    begun_with = []

    def sessions(*_):
        for number in range(2):
            begun_with.append(number)
            yield SimpleNamespace(
                replay=[0], ended=False, journal=SimpleNamespace(lost=""),
                stub=SimpleNamespace(supervisor=SimpleNamespace(state=state)),
            )  # fmt: skip

    for name, stands_in in {
        "read_request": lambda _: SimpleNamespace(root=tmp_path), "read_limits": lambda _: None,
        "_cell": lambda _: (None, None), "_sessions": sessions, "_conclude": lambda *_: None,
        "Inbox": lambda _: SimpleNamespace(closed=False), "Outbox": lambda _: None,
        "AdmissionThread": lambda _: None,
        "Loop": lambda *_, **__: SimpleNamespace(run=lambda: None),
    }.items():  # fmt: skip
        monkeypatch.setattr(process_module, name, stands_in)
    assert begun(tmp_path) == 0
    assert begun_with == list(range(played))
