"""The checker shares no code with what it checks; the executor knows no policy and no robot."""

import ast
import subprocess
import sys
from pathlib import Path

import genpolicy

ROOT = Path(genpolicy.__file__).parent
CHECKER = sorted(path.stem for path in (ROOT / "verification").glob("*.py"))
ALLOWED = (
    "genpolicy.contract", "genpolicy.errors", "genpolicy.integrity", "genpolicy.verification",
    "genpolicy.seeds",
)  # fmt: skip
FORBIDDEN = (
    "torch", "genpolicy.policies", "socket", "serial", "asyncio", "http", "urllib", "rclpy",
    "pickle", "threading", "multiprocessing", "franka", "panda_py", "time",
)  # fmt: skip


def imports_of(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            found.add(node.module)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            assert node.func.id not in ("__import__", "eval", "exec")
    return found


def test_the_checker_imports_neither_executor_nor_feasibility():
    assert {"checker", "contact", "motion"} < set(CHECKER)
    for name in CHECKER:
        for module in imports_of(ROOT / "verification" / f"{name}.py"):
            if module.startswith("genpolicy"):
                assert module.startswith(ALLOWED), (name, module)
            assert not module.startswith("importlib")


def test_the_checker_reads_an_action_in_its_own_words():
    """No part of it loads, by whatever way, what those read an action by who are checked."""
    modules = ", ".join(f"genpolicy.verification.{name}" for name in CHECKER if name != "__init__")
    code = (
        f"import sys, {modules}; print([m for m in sys.modules "
        "if m in ('genpolicy.contract.action', 'genpolicy.contract.rotation')])"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert answer.stdout.strip() == "[]"


def test_a_process_that_runs_the_checker_has_loaded_neither():
    code = (
        "import sys, genpolicy.verification.checker; "
        "print([m for m in sys.modules if m.startswith("
        "('genpolicy.execution', 'genpolicy.feasibility', 'torch'))])"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert answer.stdout.strip() == "[]"


def test_the_executor_imports_no_policy_no_driver_and_no_clock():
    files = sorted((ROOT / "execution").glob("*.py"))
    assert len(files) > 8
    for path in files:
        for module in imports_of(path):
            parts = module.split(".")
            assert parts[0] not in FORBIDDEN and not module.startswith(FORBIDDEN[1]), path
            assert "sampler" not in module, path


def test_supervisor_and_stub_know_nothing_of_feasibility_at_run_time():
    code = (
        "import sys, genpolicy.execution.stub, genpolicy.execution.supervisor; "
        "print([m for m in sys.modules if m.startswith("
        "('genpolicy.feasibility', 'genpolicy.policies', 'torch', 'pinocchio', 'mujoco'))])"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert answer.stdout.strip() == "[]"
