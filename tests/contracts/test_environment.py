"""Pins, telemetry and the two commands."""

import configparser
import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from flows.reproduce import stage_environment
from genpolicy import doctor

ROOT = Path(__file__).parents[2]
MAKEFILE = (ROOT / "Makefile").read_text()


def project() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def pinned() -> dict[str, str]:
    return doctor.pins((ROOT / "constraints.txt").read_text())


def test_everything_that_is_required_is_pinned_exactly() -> None:
    lists = [project()["dependencies"], *project()["optional-dependencies"].values()]
    names = {doctor.normalised(re.match(r"[\w.-]+", r)[0]) for requires in lists for r in requires}
    assert names - {"genpolicy"} <= set(pinned())
    assert pinned()["torch"] == "2.13.0"
    assert {"setuptools", "fastapi", "starlette", "numpy"} <= set(pinned())


def test_the_environment_is_the_one_that_is_pinned() -> None:
    # The foreign task of the tests is on the path once a test of this process has asked for it.
    own = {"genpolicy", "pip", "ring-cell"}
    installed = doctor.installed_versions()
    wrong = {n: (installed[n], v) for n, v in pinned().items() if installed.get(n, v) != v}
    assert wrong == {}
    # What torch's CUDA build brings along on Linux depends on the index and is not pinned.
    unpinned = {name for name in set(installed) - set(pinned()) - own if not _of_cuda(name)}
    assert unpinned <= {"prefect-dask"}


def _of_cuda(name: str) -> bool:
    return name.startswith(("nvidia-", "cuda-")) or name == "triton"


def test_fastapi_stays_in_the_range_in_which_prefect_works() -> None:
    assert "fastapi>=0.139,<0.151" in project()["dependencies"]
    assert doctor.check_fastapi({"fastapi": pinned()["fastapi"]}).state == doctor.OK
    assert importlib.metadata.version("fastapi") == pinned()["fastapi"]


def test_telemetry_is_off_wherever_it_could_start() -> None:
    config = configparser.ConfigParser()
    config.read(ROOT / ".dvc" / "config")
    core = dict(config["core"])
    assert (core["analytics"], core["check_update"], core["autostage"]) == ("false",) * 3
    for line in (
        "DVC_NO_ANALYTICS := 1",
        "DO_NOT_TRACK := 1",
        "PREFECT_SERVER_ANALYTICS_ENABLED := false",
        "OMP_NUM_THREADS := 1",
        "ATEN_CPU_CAPABILITY := avx2",
        "PYTHONHASHSEED := 0",
    ):
        assert f"export {line}" in MAKEFILE
    environment = stage_environment(ROOT)
    assert environment["DVC_NO_ANALYTICS"] == environment["DO_NOT_TRACK"] == "1"
    code = (
        "import os, flows.ladder\n"
        "assert os.environ['PREFECT_SERVER_ANALYTICS_ENABLED'] == 'false'\n"
        "from prefect.settings import get_current_settings as s\n"
        "assert s().server.analytics_enabled is False\n"
        "assert s().server.ephemeral.startup_timeout_seconds == 120\n"
    )
    clean = {k: v for k, v in environment.items() if not k.startswith("PREFECT") and k != "PATH"}
    subprocess.run([sys.executable, "-c", code], env=clean, cwd=ROOT, check=True)


def test_a_stage_by_hand_keeps_to_one_thread_and_to_avx2() -> None:
    # Asked of torch, which reads the variable when it first computes and keeps what it read.
    code = (
        "import os, stages, torch\n"
        "assert os.environ['ATEN_CPU_CAPABILITY'] == 'avx2'\n"
        "torch.ones(3).sum()\n"
        "assert torch.get_num_threads() == 1\n"
        "assert torch.backends.cpu.get_cpu_capability() in ('AVX2', 'DEFAULT')\n"
    )
    fixed = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "ATEN_CPU_CAPABILITY")
    bare = {name: value for name, value in os.environ.items() if name not in fixed}
    subprocess.run([sys.executable, "-c", code], env=bare, cwd=ROOT, check=True)
    assert stage_environment(ROOT)["ATEN_CPU_CAPABILITY"] == "avx2"


def test_dvc_names_no_remote_and_no_place_outside() -> None:
    text = (ROOT / ".dvc" / "config").read_text()
    assert "remote" not in text
    assert "url" not in text


@pytest.mark.parametrize("name", ["ladder", "smoke", "test", "doctor", "clean", "lint"])
def test_the_makefile_has_the_targets_that_the_readme_names(name: str) -> None:
    assert re.search(rf"^{name}:", MAKEFILE, re.MULTILINE)
    readme = (ROOT / "README.md").read_text()
    assert f"make {name}" in readme


def test_dvc_ignores_what_python_leaves_behind() -> None:
    ignored = (ROOT / ".dvcignore").read_text().split()
    assert {"__pycache__", "*.pyc", ".venv", "build"} <= set(ignored)


def test_git_ignores_the_outputs_by_a_committed_rule() -> None:
    # DVC takes its own lines back when a later stage fails, and failing is an answer here.
    assert "/artifacts/" in (ROOT / ".gitignore").read_text().split()
    for name in (".dvc/config", ".dvc/.gitignore", ".dvcignore", ".ci/run"):
        assert (ROOT / name).is_file()


PYTHONS_OF_LEROBOT = {
    "a path that is none": None,
    "one that does not run": "exit 127",
    # It makes no environment, whatever the Makefile thinks of its version.
    "an older one": f'[ "$1" = -c ] && exec {sys.executable} -c "import sys; '
    'sys.version_info = (3, 11, 9); $2"\nexit 9',
    "no such program": None,
}


@pytest.mark.parametrize("how", PYTHONS_OF_LEROBOT)
def test_lerobot_s_environment_is_left_out_with_a_sentence_where_its_python_is_not(
    tmp_path: Path, how: str
) -> None:
    """A shim of a version manager is a program by that name, and ends without running anything."""
    make = shutil.which("make")
    assert make is not None
    words = [make, "-C", str(tmp_path), "-f", str(ROOT / "Makefile"), "lerobot"]
    environment = dict(os.environ)
    if how == "no such program":
        (tmp_path / "bin").mkdir()
        for tool in ("bash", "cat", "cut", "sha256sum", "python3.11"):
            if found := shutil.which(tool):
                (tmp_path / "bin" / tool).symlink_to(found)
        environment["PATH"] = str(tmp_path / "bin")
    else:
        python = tmp_path / "python3.12"
        if script := PYTHONS_OF_LEROBOT[how]:
            python.write_text(f"#!/bin/bash\n{script}\n")
            python.chmod(0o755)
        words.append(f"PYTHON_LEROBOT={python}")
    done = subprocess.run(words, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    said = "No Python 3.12 or 3.13 found, which LeRobot needs; skipped. Install one, or name it: "
    assert said + "make PYTHON_LEROBOT=/path/to/python3.12 lerobot" in done.stdout
    assert not (tmp_path / "build").exists()


@pytest.mark.parametrize("told", ["", "/a place"])
def test_tests_write_where_nothing_waits_for_a_disk_or_where_they_are_told(
    tmp_path: Path, told: str
) -> None:
    asking = tmp_path / "asking.mk"
    asking.write_text("include Makefile\nasked:\n\t@echo '$(WRITTEN_TO)'\n")
    environment = {**os.environ, "TMPDIR": told}
    said = subprocess.run(
        ["make", "--silent", "-f", str(asking), "asked"], cwd=ROOT, env=environment,
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    memory = Path("/dev/shm")
    room = memory.is_dir() and shutil.disk_usage(memory).free > 10_000_000 * 1024
    assert said.stdout == (told or ("/dev/shm" if room else "/tmp")) + "\n"


LINTERS = ("ruff", "mypy", "lint-imports")


@pytest.mark.parametrize("failing", [None, *LINTERS, "python"])
def test_make_test_fails_where_tests_or_a_linter_do_and_says_what_it_said(
    tmp_path: Path, failing: str | None
) -> None:
    """The linters run beside the tests: what they end with would be lost without being asked."""
    programs = tmp_path / ".venv" / "bin"
    programs.mkdir(parents=True)
    for name in ("Makefile", "constraints.txt", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path / name)
    for name in (*LINTERS, "python"):
        late = "sleep 0.5; " if name == failing and name != "python" else ""
        (programs / name).write_text(
            f"#!/bin/bash\n{late}echo {name} ran\nexit {int(name == failing)}\n"
        )
        (programs / name).chmod(0o755)
    asking = tmp_path / "asking.mk"
    asking.write_text("include Makefile\nstamp:\n\t@echo '$(WANTED)' > .venv/.ok\n")
    environment = {name: value for name, value in os.environ.items() if name != "MAKEFLAGS"}

    def make(*words: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(
            ["make", "--no-print-directory", "-C", str(tmp_path), *words],
            env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip

    assert make("-f", "asking.mk", "stamp").returncode == 0
    done = make("test")
    assert (done.returncode != 0) == (failing is not None), done.stderr
    for name in (*LINTERS, "python"):
        assert f"{name} ran" in done.stdout
    assert done.stdout.index("python ran") < done.stdout.index("ruff ran")


def test_what_a_test_that_passed_wrote_is_gone(pytestconfig: pytest.Config) -> None:
    assert pytestconfig.getini("tmp_path_retention_policy") == "failed"
