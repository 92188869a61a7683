"""Mutants run: a forked process each, in which one module is compiled from other text."""

import contextlib
import importlib.abc
import importlib.machinery
import importlib.util
import json
import os
import resource
import signal
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

from benchmarks.mutation.plan import ROOT, Mutant, cases_of, change_of, tests_of, text_of

OURS = ("gates", "genpolicy", "tests", "benchmarks")
KERNELS = ("genpolicy/compiled.py", "genpolicy/feasibility/kernels/", "genpolicy/policies/kernels/")
CPU_S = 600
"""A mutant that needs more processor time than this is stopped; it may hang. All tests of
`gates/need` need more than 150 on a busy machine, where a survivor was once called killed."""
SURVIVED, KILLED = "survived", "killed"
"""What tests say of a mutant; every other outcome is none of theirs."""
NO_TEST = 5
"""Exit code of pytest where no test was chosen."""


class _Changed(importlib.machinery.SourceFileLoader):
    """Compiles a module from other text than lies on disk."""

    text = ""

    def get_code(self, fullname: str):
        return compile(self.text, self.path, "exec", dont_inherit=True)


class _Finder(importlib.abc.MetaPathFinder):
    def __init__(self, path: str, text: str) -> None:
        self.name = path.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
        self.path, self.text = str(ROOT / path), text

    def find_spec(self, fullname, path=None, target=None):
        if fullname != self.name:
            return None
        loader = _Changed(fullname, self.path)
        loader.text = self.text
        return importlib.util.spec_from_file_location(fullname, self.path, loader=loader)


def warm_up(tests: Sequence[str], changed: str) -> None:
    """Import what every mutant needs and none changes: all that tests load but what is changed.

    Args:
        tests: Tests that will be asked.
        changed: The package of the mutants; of `gates` nothing below imports it.
    """
    ours = OURS if changed == "genpolicy" else [name for name in OURS if name != "genpolicy"]
    read, write = os.pipe()
    if os.fork() == 0:
        try:
            _silence(os.devnull)
            import pytest

            pytest.main(["--collect-only", "-q", "-p", "no:cacheprovider", *tests])
            names = [name for name in sys.modules if name.partition(".")[0] not in ours]
            os.write(write, "\n".join(names).encode())
        finally:
            os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        names = pipe.read().decode().split()
    os.wait()
    for name in (*names, "pytest"):
        with contextlib.suppress(Exception):
            importlib.import_module(name)
    assert not [name for name in sys.modules if name.partition(".")[0] == changed]


def _silence(file: str | Path) -> None:
    out = os.open(file, os.O_WRONLY | os.O_CREAT)
    os.dup2(out, 1)
    os.dup2(out, 2)


def outcome(path: str, text: str | None, tests: Sequence[str]) -> tuple[str, float, str]:
    """Run tests with a module of other text: outcome, processor seconds, and what turned red.

    An outcome that is neither `SURVIVED` nor `KILLED` is said in brackets: no test turned red.
    """
    with tempfile.TemporaryDirectory() as scratch:
        log = Path(scratch) / "log"
        child = os.fork()
        if child == 0:
            _run(path, text, tests, log, Path(scratch))
        _, status, used = os.wait4(child, 0)
        said = log.read_text(errors="replace") if log.is_file() else ""
    code = os.waitstatus_to_exitcode(status)
    red = [line.split(" - ")[0] for line in said.splitlines() if line.startswith(("FAILED", "ERR"))]
    return name_of(code), round(used.ru_utime + used.ru_stime, 2), (red or [""])[0]


def name_of(code: int) -> str:
    """What an exit code says of a mutant: only what a test noticed is killed.

    A signal ended the others, that of too much processor time mostly: such a mutant may hang, or
    only be slow, or survive on a faster machine.
    """
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        return "stopped (time)"
    if code < 0:
        return f"stopped ({signal.Signals(-code).name})"
    return {0: SURVIVED, NO_TEST: "stopped (no test)"}.get(code, KILLED)


def _run(path: str, text: str | None, tests: Sequence[str], log: Path, scratch: Path) -> None:
    code = 3
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S + 5))
        signal.signal(signal.SIGXCPU, signal.SIG_DFL)
        _silence(log)
        sys.dont_write_bytecode = True
        if text is not None:
            sys.meta_path.insert(0, _Finder(path, text))
        if path.startswith(KERNELS):  # what was compiled of the true text must not be found
            import numba

            numba.config.CACHE_DIR = str(scratch / "kernels")  # type: ignore[attr-defined]
        import pytest

        options = ["-x", "-q", "--no-header", "--tb=no", "-p", "no:cacheprovider", "--timeout=0"]
        options += ["-k", cases_of(path)] if cases_of(path) else []
        code = int(pytest.main([*options, f"--basetemp={scratch}/tests", *tests]))
    except BaseException:
        code = 3
    finally:
        with contextlib.suppress(BaseException):
            sys.stdout.flush()
        os._exit(code)


def require_green(tests: Mapping[str, Sequence[str]]) -> None:
    """Ask each test once without a mutant.

    Args:
        tests: By module, what its mutants are held against.

    Raises:
        SystemExit: One is red.
    """
    clean: dict[str, float] = {}
    for path in sorted(tests):
        for name in set(tests[path]) - set(clean):
            found, clean[name], red = outcome(path, None, [name])
            if found != SURVIVED:
                raise SystemExit(f"{name} is red without any mutant: {red}")
            print(f"{name}: green in {clean[name]} s of processor time", flush=True)


def run(
    mutants: Sequence[Mutant], out: Path, jobs: int, *, near: bool, green: bool = False
) -> None:
    """Run mutants; append a line each.

    Args:
        mutants: In which order.
        out: File of results.
        jobs: How many at a time.
        near: Only the tests nearest to the module, as a first look: they take a second or two.
        green: Whether the tests are known to be green without any mutant, and not asked first.
    """

    def tests(path: str) -> list[str]:
        return tests_of(path)[:1] if near else tests_of(path)

    packages = {mutant.path.partition("/")[0] for mutant in mutants}
    warm_up(
        sorted({name for mutant in mutants for name in tests(mutant.path)}),
        "genpolicy" if "genpolicy" in packages else "gates",
    )
    if not green:
        require_green({mutant.path: tests(mutant.path) for mutant in mutants})

    def one(mutant: Mutant) -> tuple[Mutant, str, float, str]:
        text = text_of(mutant.path, mutant.kind, mutant.occurrence)
        return mutant, *outcome(mutant.path, text, tests(mutant.path))

    out.parent.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(jobs) as pool, out.open("a") as lines:
        for mutant, name, seconds, red in pool.map(one, mutants):
            row = {
                **asdict(mutant),
                "change": change_of(mutant),
                "outcome": name,
                "cpu_s": seconds,
                "red": red,
            }
            lines.write(json.dumps(row) + "\n")
            lines.flush()
            if name != KILLED:
                print(f"{name} {mutant.path}:{mutant.line} {row['change']}", flush=True)
