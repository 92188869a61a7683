"""A repository is judged with its own code: an installed copy with other rules is refused."""

import shutil
from pathlib import Path

import pytest

import gates
import genpolicy
from gates.proof import judge
from gates.running import require_running_code
from genpolicy.errors import IntegrityError

PACKAGES = (genpolicy, gates)
HASH = "[0-9a-f]{16}"


def _copy(root: Path) -> None:
    for package in PACKAGES:
        shutil.copytree(
            Path(package.__file__).parent,
            root / package.__name__,
            ignore=shutil.ignore_patterns("__pycache__"),
            dirs_exist_ok=True,
        )


def test_the_checkout_itself_and_a_workspace_without_code_are_judged(tmp_path):
    require_running_code(Path(__file__).parents[2])
    require_running_code(tmp_path)


@pytest.mark.parametrize("name", ["gates/bounds.py", "genpolicy/pages/style.css"])
def test_another_file_under_the_root_is_refused_by_name(tmp_path, name):
    _copy(tmp_path)
    require_running_code(tmp_path)
    file = tmp_path / name
    file.write_text(file.read_text() + "\n")
    with pytest.raises(
        IntegrityError,
        match=f"the running {name} is {HASH} of .*, expected {HASH} of .*run `python -m gates`",
    ):
        require_running_code(tmp_path)
    file.unlink()
    with pytest.raises(IntegrityError, match=f"the running {name} is .*expected missing"):
        require_running_code(tmp_path)


def test_a_file_that_only_the_root_has_is_refused(tmp_path):
    _copy(tmp_path)
    (tmp_path / "gates" / "laxer.py").write_text("LIMIT = 1\n")
    with pytest.raises(IntegrityError, match=r"the running gates/laxer\.py is missing"):
        require_running_code(tmp_path)


@pytest.mark.parametrize("gate", ["B", "E"])
def test_no_gate_is_judged_by_other_code(ladder, gate):
    judge(ladder, gate)
    (ladder / "gates").mkdir()
    (ladder / "gates" / "__init__.py").write_text("")
    with pytest.raises(IntegrityError, match="the running gates/"):
        judge(ladder, gate)
