"""A workspace with `params.yaml` and nothing else, and stages called in it."""

import importlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Generator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

from genpolicy.progress import STAGE
from genpolicy.tasks.fixtures import PINS
from stages._stage import main

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests" / "gates"))

from made_before import nothing_made_twice  # noqa: E402

AT_WORK = re.compile(r"^\[\d+/\d+\] \S+ · for .*\n", re.MULTILINE)
"""Said every ten seconds of a stage that still works: by a slow machine before a refusal, too."""
Edit = Callable[[dict[str, Any]], Any]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """For tests of this folder alone: many judge the same evidence of the gates' tests."""
    if Path(__file__).parent not in item.path.parents:
        return (yield)
    with nothing_made_twice():
        return (yield)


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with the parameters and the pinned fixtures of the checkout."""
    shutil.copy(ROOT / PINS, tmp_path)
    (tmp_path / "params.yaml").write_bytes((ROOT / "params.yaml").read_bytes())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(STAGE, "")  # each stage sets it, and no test behind sees it
    return tmp_path


@pytest.fixture
def edit() -> Callable[[Path, Edit], None]:
    """Change `params.yaml` of a workspace."""

    def change(workspace: Path, how: Edit) -> None:
        path = workspace / "params.yaml"
        params = yaml.safe_load(path.read_text())
        how(params)
        path.write_text(yaml.safe_dump(params, sort_keys=False))

    return change


@pytest.fixture
def stage(capsys: pytest.CaptureFixture[str]) -> Callable[[str], tuple[int, str]]:
    """Run a stage in this process, in the current folder; exit code and what it said."""

    def run(name: str) -> tuple[int, str]:
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main(name, importlib.import_module(f"stages.{name}").work)
        assert isinstance(end.value.code, int)
        return end.value.code, AT_WORK.sub("", capsys.readouterr().err)

    return run


@pytest.fixture(scope="session")
def process() -> Callable[..., tuple[int, str]]:
    """Run a stage in a process of its own, with what `subprocess.run` takes; code and stderr."""

    def run(name: str, workspace: Path, **options: Any) -> tuple[int, str]:
        done = subprocess.run(
            [sys.executable, "-B", "-m", f"stages.{name}"],
            cwd=workspace,
            env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
            capture_output=True,
            text=True,
            check=False,
            **options,
        )
        return done.returncode, AT_WORK.sub("", done.stderr)

    return run


@pytest.fixture(scope="session")
def gate_evidence() -> ModuleType:
    """The synthetic evidence of the gate tests, on which every gate passes."""
    path = ROOT / "tests" / "gates" / "evidence.py"
    spec = importlib.util.spec_from_file_location("stage_gate_evidence", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(path.parent)  # it reads what lies beside it
        spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def _built(tmp_path_factory: pytest.TempPathFactory, gate_evidence: ModuleType) -> Path:
    root = tmp_path_factory.mktemp("built")
    gate_evidence.build(root)
    return root


@pytest.fixture
def evidence(workspace: Path, _built: Path) -> Path:
    """A workspace with evidence on which gates A to D pass, and all sections of the settings."""
    shared = yaml.safe_load((workspace / "params.yaml").read_text())
    shutil.copytree(_built, workspace, dirs_exist_ok=True)
    own = yaml.safe_load((workspace / "params.yaml").read_text())
    both = {name: {**shared[name], **own[name]} for name in ("horizons", "compute")}
    params = {**shared, **own, **both}
    (workspace / "params.yaml").write_text(yaml.safe_dump(params, sort_keys=False))
    return workspace


EPISODES = 14


@pytest.fixture(scope="session")
def recorded(
    tmp_path_factory: pytest.TempPathFactory, process: Callable[..., tuple[int, str]]
) -> Path:
    """A workspace with recordings of the scripted operators, by the stages themselves."""
    folder = tmp_path_factory.mktemp("recorded")
    params = yaml.safe_load((ROOT / "params.yaml").read_text())
    shutil.copy(ROOT / PINS, folder)
    params["record"].update(episodes=EPISODES, shares={"nominal": 1.0})
    (folder / "params.yaml").write_text(yaml.safe_dump(params))
    for stage in ("task", "record"):
        code, said = process(stage, folder)
        assert code == 0, said
    return folder
