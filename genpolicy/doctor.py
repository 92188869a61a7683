"""`genpolicy doctor`: is this machine, and this environment, fit to run the ladder?

Standard library only, so that it can still speak when the environment is broken. Every finding
says what to do. Exit code 0 when nothing is wrong (a warning is not wrong), else 2.
"""

import argparse
import configparser
import importlib.metadata
import importlib.util
import json
import os
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

OK, WARNING, WRONG = "ok", "warning", "wrong"

PYTHON_TESTED = (3, 11)
PYTHON_BELOW = (3, 13)
FASTAPI_FROM, FASTAPI_BELOW = (0, 139), (0, 151)
DISK_NEEDED_GIB = 5.0
MEMORY_NEEDED_GIB = 4.0
REPAIR = "Run `make env` (remove .venv first if that does not help)."

_PIN = re.compile(r"^(?P<name>[A-Za-z0-9][A-Za-z0-9._-]*)==(?P<version>[^\s;#]+)$")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


@dataclass(frozen=True)
class Finding:
    """One line of the table.

    Attributes:
        item: What was looked at.
        state: `ok`, `warning` or `wrong`.
        found: What is there.
        action: What to do; empty when all is well.
    """

    item: str
    state: str
    found: str
    action: str = ""


def pins(text: str) -> dict[str, str]:
    """Exact versions by normalised name from the text of a constraints file.

    Raises:
        ValueError: A line is neither a comment nor `name==version`, or a name stands twice.
    """
    result: dict[str, str] = {}
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        if not line or line.startswith("#"):
            continue
        match = _PIN.match(line)
        if match is None:
            raise ValueError(f"line {number} is {line!r}, expected name==version")
        name = normalised(match["name"])
        if name in result:
            raise ValueError(f"line {number} names {name} a second time")
        result[name] = match["version"]
    return result


def normalised(name: str) -> str:
    """The one spelling of a distribution's name (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def installed_versions() -> dict[str, str]:
    """Versions of what is installed, by normalised name, without local labels such as `+cpu`."""
    return {
        normalised(distribution.metadata["Name"]): distribution.version.split("+")[0]
        for distribution in importlib.metadata.distributions()
        if distribution.metadata["Name"]
    }


def check_pins(
    pinned: Mapping[str, str], installed: Mapping[str, str], required: Iterable[str]
) -> Finding:
    """Installed versions against the pins, and what the project requires against what is there."""
    wrong = [
        f"{name} {installed[name]} (pinned {version})"
        for name, version in pinned.items()
        if name in installed and installed[name] != version
    ]
    missing = [f"{name} missing" for name in required if name not in installed]
    loose = [f"{name} not pinned" for name in required if name not in pinned]
    found = wrong + missing + loose
    if not found:
        number = sum(name in installed for name in pinned)
        return Finding("versions", OK, f"{number} packages as pinned in constraints.txt")
    shown = ", ".join(found[:6]) + (f" and {len(found) - 6} more" if len(found) > 6 else "")
    return Finding("versions", WRONG, shown, REPAIR)


def check_fastapi(installed: Mapping[str, str]) -> Finding:
    """Prefect's server works with a narrow range of fastapi only."""
    version = installed.get("fastapi")
    expected = f">={_dotted(FASTAPI_FROM)},<{_dotted(FASTAPI_BELOW)}"
    if version is None:
        return Finding("fastapi", WRONG, "missing", REPAIR)
    if FASTAPI_FROM <= _leading(version) < FASTAPI_BELOW:
        return Finding("fastapi", OK, f"{version} ({expected}, needed by Prefect's server)")
    return Finding(
        "fastapi",
        WRONG,
        f"{version}, expected {expected}: Prefect's server does not run with it",
        f"Run `pip install -c constraints.txt fastapi`. {REPAIR}",
    )


def check_python(version: tuple[int, int]) -> Finding:
    """The interpreter's version."""
    if version == PYTHON_TESTED:
        return Finding("python", OK, platform.python_version())
    if PYTHON_TESTED < version < PYTHON_BELOW:
        action = f"If something fails, use {_dotted(PYTHON_TESTED)}: the pins were tried there."
        return Finding("python", WARNING, platform.python_version(), action)
    return Finding(
        "python",
        WRONG,
        f"{_dotted(version)}, expected {_dotted(PYTHON_TESTED)}",
        "Remove .venv, then `make env PYTHON=<a Python 3.11>`.",
    )


def check_space(item: str, free_gib: float, needed_gib: float, action: str) -> Finding:
    """Free disk or memory against what the default ladder needs, GiB."""
    found = f"{free_gib:.1f} GiB free"
    if free_gib - needed_gib >= 0:
        return Finding(item, OK, found)
    return Finding(item, WARNING, f"{found}, expected {needed_gib:.0f} GiB", action)


def check_dvc_config(text: str) -> Finding:
    """Telemetry and the update check of DVC must be off in the committed configuration."""
    config = configparser.ConfigParser()
    try:
        config.read_string(text)
    except configparser.Error as error:
        return Finding(
            "telemetry",
            WRONG,
            f".dvc/config is not readable ({type(error).__name__})",
            "Restore .dvc/config from version control.",
        )
    on = [
        key
        for key in ("analytics", "check_update")
        if config.get("core", key, fallback="true").strip().lower() != "false"
    ]
    if on:
        return Finding(
            "telemetry",
            WRONG,
            f"core.{' and core.'.join(on)} not false in .dvc/config",
            "Restore .dvc/config from version control.",
        )
    return Finding("telemetry", OK, "off for DVC; the flows turn it off for Prefect")


def check_lock(root: Path) -> Finding:
    """Whether a DVC process holds, or left behind, a lock on this workspace."""
    lock = root / ".dvc" / "tmp" / "rwlock"
    try:
        held: object = json.loads(lock.read_text() or "{}") if lock.is_file() else {}
    except (OSError, ValueError):
        held = "not readable"
    if not held or held in ({}, {"read": {}, "write": {}}):
        return Finding("DVC lock", OK, "free")
    owners = sorted({int(pid) for pid in re.findall(r'"pid": (\d+)', json.dumps(held))})
    alive = [pid for pid in owners if Path(f"/proc/{pid}").exists()]
    if alive:
        processes = ", ".join(map(str, alive))
        return Finding(
            "DVC lock", WARNING, f"held by process {processes}", "Wait until that run has ended."
        )
    return Finding(
        "DVC lock",
        WARNING,
        "left behind by a process that has ended",
        "Make sure that no stage still runs, then remove .dvc/tmp/rwlock.",
    )


def check_git(root: Path) -> Finding:
    """Reports and lock files are versioned with git; the smoke workspace asks it for the files."""
    if shutil.which("git") is None:
        return Finding("git", WRONG, "not on PATH", "Install git.")
    command = ["git", "-C", str(root), "rev-parse", "--short", "HEAD"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        return Finding("git", OK, f"commit {done.stdout.strip()}")
    return Finding("git", WARNING, "no commit here", "Work in a clone: git versions the reports.")


def check_rendering() -> Finding:
    """Pictures are drawn by ray casting; no display, GPU or OpenGL library is asked for."""
    there = importlib.util.find_spec("mujoco") is not None
    if there:
        return Finding("rendering", OK, "no OpenGL needed (pictures by ray casting)")
    return Finding("rendering", WRONG, "mujoco missing", REPAIR)


def examine(root: Path) -> list[Finding]:
    """All findings on the checkout `root` and on the interpreter that runs this."""
    installed = installed_versions()
    findings = [check_python((sys.version_info.major, sys.version_info.minor))]
    findings += _guarded("versions", lambda: _versions(root, installed))
    torch = importlib.metadata.version("torch") if "torch" in installed else "missing"
    findings.append(Finding("torch", OK if torch != "missing" else WRONG, torch))
    findings.append(check_fastapi(installed))
    free_gib = shutil.disk_usage(root).free / 2**30
    findings.append(check_space("disk", free_gib, DISK_NEEDED_GIB, "Free space first."))
    findings += _guarded("memory", _memory)
    findings += _guarded(
        "telemetry", lambda: check_dvc_config((root / ".dvc" / "config").read_text())
    )
    findings += [check_rendering(), check_lock(root), check_git(root)]
    findings.append(Finding("processors", OK, f"{os.cpu_count()}"))
    return findings


def report(root: Path, *, as_json: bool) -> int:
    """Print the findings on the checkout `root`; returns the exit code."""
    findings = examine(root)
    if as_json:
        print(json.dumps([asdict(finding) for finding in findings], indent=2, ensure_ascii=False))
    else:
        width = max(len(finding.item) for finding in findings)
        for finding in findings:
            print(f"{finding.state:8}{finding.item:{width + 2}}{finding.found}")
            if finding.action:
                print(f"{'':{width + 10}}{finding.action}")
    return 2 if any(finding.state == WRONG for finding in findings) else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """`genpolicy doctor` without the library of the command line, which may be what is broken."""
    parser = argparse.ArgumentParser(
        prog="python -m genpolicy.doctor",
        description="Check this machine and environment. Exit codes: 0 fit, 2 something is wrong.",
        epilog="Example: python -m genpolicy.doctor --json",
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--root", type=Path, default=Path(), help="the checkout; default: here")
    options = parser.parse_args(arguments)
    return report(options.root, as_json=options.json)


def _versions(root: Path, installed: Mapping[str, str]) -> Finding:
    pinned = pins((root / "constraints.txt").read_text())
    return check_pins(pinned, installed, _required())


def _required() -> list[str]:
    """Names that the project requires at run time, without its extras."""
    names = []
    for line in importlib.metadata.requires("genpolicy") or ():
        match = _NAME.match(line)
        if match is not None and "extra ==" not in line:
            names.append(normalised(match.group()))
    return sorted(names)


def _memory() -> Finding:
    available = re.search(r"MemAvailable:\s+(\d+) kB", Path("/proc/meminfo").read_text())
    if available is None:
        raise ValueError("no MemAvailable in /proc/meminfo")
    free_gib = int(available.group(1)) / 2**20
    return check_space("memory", free_gib, MEMORY_NEEDED_GIB, "Close other programs first.")


def _guarded(item: str, check: Callable[[], Finding]) -> list[Finding]:
    """A check that cannot be made is itself a finding: wrong for files of ours, else a warning."""
    try:
        return [check()]
    except importlib.metadata.PackageNotFoundError as error:
        return [Finding(item, WRONG, f"{error} is not installed", REPAIR)]
    except (OSError, ValueError) as error:
        state = WARNING if item == "memory" else WRONG
        action = "" if item == "memory" else "Run it in a clone, with the files as committed."
        return [Finding(item, state, f"not checkable ({error})", action)]


def _leading(version: str) -> tuple[int, int]:
    numbers = re.findall(r"\d+", version)
    return (int(numbers[0]), int(numbers[1])) if len(numbers) > 1 else (-1, -1)


def _dotted(version: tuple[int, int]) -> str:
    return ".".join(map(str, version))


if __name__ == "__main__":
    sys.exit(main())
