"""A toy ladder: three stages behind two gates, without any numeric library."""

import fcntl
import socket
import struct
import subprocess
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest

from flows import prefect_settings  # noqa: F401

# isort: split
from prefect.testing.utilities import prefect_test_harness

# Prefect talks to its own server over the loopback interface; without any network it is down.
SIOCGIFFLAGS, SIOCSIFFLAGS, IFF_UP = 0x8913, 0x8914, 0x1

STAGE = """
import json, pathlib, sys, yaml
name = sys.argv[1]
params = yaml.safe_load(pathlib.Path("params.yaml").read_text())
code = params[name]["code"]
if code:
    print(f"{name}: Gate A refuses: share is 0.1, required >= 0.5; see reports/gate_a.json. Stop.",
          file=sys.stderr)
    sys.exit(code)
folder = pathlib.Path("artifacts") / name
folder.mkdir(parents=True, exist_ok=True)
(folder / "value.txt").write_text(str(params[name]["value"]))
runs = pathlib.Path("build") / "runs.txt"
runs.parent.mkdir(exist_ok=True)
with runs.open("a") as stream:
    stream.write(name + "\\n")
if name.startswith("gate_"):
    report = pathlib.Path("reports") / f"{name}.md"
    report.parent.mkdir(exist_ok=True)
    report.write_text(f"# {name}\\n\\nPASS\\n")
    card = pathlib.Path("cards/card.txt")
    said = {"verdict": params[name].get("verdict", "PASS"), "decision": "Return to the dataset."}
    if name == "gate_e":
        said["verdict"] = card.read_text() if card.exists() else "PENDING_REVIEW"
    report.with_suffix(".json").write_text(json.dumps(said))
"""

# What a flow asks before it lets gate E pass: `python -m genpolicy card verify`, of the workspace.
PROGRAM = """
import pathlib, sys, yaml
assert sys.argv[1:] == ["card", "verify"], sys.argv
card = pathlib.Path("cards/card.txt")
verdict = card.read_text() if card.exists() else "PENDING_REVIEW"
verdict = yaml.safe_load(pathlib.Path("params.yaml").read_text())["gate_e"]["asked"] or verdict
print(f"{verdict}: so it is said.")
print(f"  {verdict:<14} signature_valid: the card is refused: signed by the unknown key abc")
sys.exit(0 if verdict == "PASS" else 3)
"""

NAMES = ("record", "gate_a", "generators", "gate_b")


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A git checkout of the toy ladder."""
    return _made(tmp_path / "checkout", NAMES)


@pytest.fixture
def waiting_checkout(tmp_path: Path) -> Path:
    """Another, which ends with a gate E that waits for `cards/card.txt`, a verdict."""
    folder = _made(tmp_path / "waiting", ("gate_a", "gate_e"))
    (folder / "genpolicy").mkdir()
    (folder / "genpolicy" / "__init__.py").touch()
    (folder / "genpolicy" / "__main__.py").write_text(textwrap.dedent(PROGRAM))
    params = folder / "params.yaml"
    params.write_text(params.read_text() + "  asked: ''\n")
    pipeline = folder / "dvc.yaml"
    text = pipeline.read_text()
    pipeline.write_text(text.replace("stage.py, artifacts/gate_a]", "stage.py, cards]"))
    (folder / "cards").mkdir()
    (folder / "cards" / "README.md").write_text("Signed cards lie here.\n")
    return folder


@pytest.fixture(scope="module")
def server(loopback: None) -> Iterator[None]:
    """A Prefect server of its own, with an empty database, for a file of tests."""
    with prefect_test_harness(server_startup_timeout=120):
        yield


def _made(folder: Path, names: tuple[str, ...]) -> Path:
    (folder / ".dvc").mkdir(parents=True)
    (folder / ".dvc" / "config").write_text("[core]\n    analytics = false\n")
    (folder / ".gitignore").write_text("/artifacts/\n/build/\n")
    (folder / "stage.py").write_text(textwrap.dedent(STAGE))
    (folder / "params.yaml").write_text(
        "".join(f"{name}:\n  value: 1\n  code: 0\n  verdict: PASS\n" for name in names)
    )
    lines = ["stages:"]
    for place, name in enumerate(names):
        lines += [f"  {name}:", f"    cmd: python stage.py {name}", "    deps: [stage.py"]
        lines[-1] += f", artifacts/{names[place - 1]}]" if place else "]"
        lines += [f"    params: [{name}]", f"    outs: [artifacts/{name}]"]
        if name.startswith("gate_"):
            lines += [f"    metrics: [reports/{name}.md: {{cache: false}}]"]
    (folder / "dvc.yaml").write_text("\n".join(lines) + "\n")
    subprocess.run(["git", "init", "-q", str(folder)], check=True)
    return folder


def _loopback_works() -> bool:
    with socket.socket() as listener, socket.socket() as caller:
        try:
            listener.bind(("127.0.0.1", 0))
            listener.listen(1)
            caller.settimeout(1.0)
            caller.connect(listener.getsockname())
        except OSError:
            return False
    return True


def _raise_loopback() -> None:
    """`ip link set lo up`, which a fresh network namespace leaves to its user."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as handle:
        request = struct.pack("16sh14x", b"lo", 0)
        flags = struct.unpack("16sh14x", fcntl.ioctl(handle, SIOCGIFFLAGS, request))[1]
        fcntl.ioctl(handle, SIOCSIFFLAGS, struct.pack("16sh14x", b"lo", flags | IFF_UP))


@pytest.fixture(scope="session", autouse=True)
def loopback() -> None:
    """A machine that can talk to itself, also where there is no network at all."""
    if _loopback_works():
        return
    try:
        _raise_loopback()
    except OSError as error:
        pytest.skip(f"the loopback interface is down and cannot be raised ({error.strerror})")
    if not _loopback_works():
        pytest.skip("the loopback interface is down")
