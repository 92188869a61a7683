"""A toy ladder: three stages behind two gates, without any numeric library."""

import fcntl
import socket
import struct
import subprocess
import textwrap
from pathlib import Path

import pytest

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
    said = {"verdict": params[name].get("verdict", "PASS"), "decision": "Return to the dataset."}
    report.with_suffix(".json").write_text(json.dumps(said))
"""

NAMES = ("record", "gate_a", "generators", "gate_b")


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A git checkout of the toy ladder."""
    folder = tmp_path / "checkout"
    (folder / ".dvc").mkdir(parents=True)
    (folder / ".dvc" / "config").write_text("[core]\n    analytics = false\n")
    (folder / ".gitignore").write_text("/artifacts/\n/build/\n")
    (folder / "stage.py").write_text(textwrap.dedent(STAGE))
    (folder / "params.yaml").write_text(
        "".join(f"{name}:\n  value: 1\n  code: 0\n  verdict: PASS\n" for name in NAMES)
    )
    lines = ["stages:"]
    for place, name in enumerate(NAMES):
        lines += [f"  {name}:", f"    cmd: python stage.py {name}", "    deps: [stage.py"]
        lines[-1] += f", artifacts/{NAMES[place - 1]}]" if place else "]"
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
