import os
import socketserver
import sys
import threading
import time

import numpy as np
import pytest

from genpolicy.candidates.wire import launched, processes
from genpolicy.candidates.wire.connection import dial, free_port
from genpolicy.candidates.wire.entry import verify_files
from genpolicy.candidates.wire.faults import Fault, PolicyError
from genpolicy.candidates.wire.launched import Launched
from genpolicy.candidates.wire.printed import KEPT_BYTES, Printed
from genpolicy.candidates.wire.processes import listens, marked
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.integrity.hashing import sha256_file

SERVER = """
import os, subprocess, sys
from genpolicy.candidates.wire.connection import Listening
child = subprocess.Popen(["sleep", "600"])
left = subprocess.Popen(["sh", "-c", "sleep 600 & echo $!"], start_new_session=True,
                        stdout=subprocess.PIPE, text=True)
orphan = int(left.stdout.readline())
left.wait()
with Listening(lambda message: message, {"pid": os.getpid(), "child": child.pid,
                                         "orphan": orphan, "here": os.getcwd()},
               port=int(sys.argv[1])) as server:
    server.serve_forever()
"""


@pytest.fixture
def entry(entry_of, tmp_path):
    (tmp_path / "server.py").write_text(SERVER)
    return entry_of(address=None, command=[sys.executable, "server.py", "{port}"])


def alive(pid):
    try:
        os.kill(pid, 0)
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


def metadata(address):
    line = dial(address, allowed=None, timeout_s=60.0)
    line.close()
    return line.metadata


def test_it_runs_in_the_folder_of_its_entry_and_ends_with_all_that_it_started(entry, tmp_path):
    with Launched(entry, tmp_path) as running:
        said = metadata(running.address)
        assert said["here"] == str(tmp_path)
        assert running.died() is None
        started = [said["pid"], said["child"], said["orphan"]]
        assert all(alive(pid) for pid in started)
    # A kill is carried out some time; the orphan left group, session and parent before.
    while any(alive(pid) for pid in started):
        time.sleep(0.05)


def test_a_server_that_ends_at_once_is_told_with_its_last_words(entry_of, tmp_path):
    broken = entry_of(
        address=None,
        command=[sys.executable, "-c", "raise SystemExit('no weights at {port}'[:10])"],
    )
    with pytest.raises(PolicyError, match="no weights") as error:
        Launched(broken, tmp_path)
    assert error.value.fault is Fault.CLOSED


def test_a_server_that_never_listens_is_late_and_ended(entry_of, tmp_path, monkeypatch):
    """By a clock that stands until the server runs: no slow machine makes it late before."""
    pid = tmp_path / "pid"
    clock = lambda: 3.0 if pid.exists() and pid.read_text() else 0.0  # noqa: E731
    monkeypatch.setattr(launched.time, "monotonic", clock)
    script = "import os, time; open('pid', 'w').write(str(os.getpid())); time.sleep(600); '{port}'"
    deaf = entry_of(address=None, command=[sys.executable, "-c", script], start_timeout_s=2.0)
    with pytest.raises(PolicyError, match="does not listen after 2 s") as error:
        Launched(deaf, tmp_path)
    assert error.value.fault is Fault.LATE
    assert not alive(int(pid.read_text()))


def test_of_what_a_server_prints_the_end_is_kept_and_nothing_waits(entry_of, tmp_path):
    """Eight megabytes, then it ends: a pipe that nobody reads would hold it for ever."""
    script = (
        "import sys\nfor _ in range(8192): sys.stdout.write('x' * 1023 + chr(10))\n"
        "sys.exit('no room') if '{port}' else None"
    )
    chatty = entry_of(address=None, command=[sys.executable, "-c", script])
    with pytest.raises(PolicyError, match=r"it ended with 1; its last words: no room, expected"):
        Launched(chatty, tmp_path)
    printed = Printed()
    for _ in range(4):
        os.write(printed.write_end, b"y" * KEPT_BYTES)
    os.write(printed.write_end, b"end")
    os.close(printed.write_end)
    printed.drained(60.0)
    assert printed.last_words(10**9) == "y" * (KEPT_BYTES - 3) + "end"


def test_who_reads_no_more_does_not_wait_for_who_still_may_print():
    printed = Printed()
    printed.close()
    with pytest.raises(BrokenPipeError):
        os.write(printed.write_end, b"x")
    os.close(printed.write_end)


def test_a_server_that_dies_later_says_why(entry, tmp_path, task):
    """Asked while it is gone: its last words, and not only that nobody listens."""
    dies = "lambda message: print('out of memory', flush=True) or os._exit(9)"
    (tmp_path / "server.py").write_text(SERVER.replace("lambda message: message", dies))
    with Launched(entry, tmp_path) as running:
        policy = RemotePolicy(entry, running.address, task.observation, ended=running.died)
        seen = np.zeros((2, task.observation.dim))
        with pytest.raises(PolicyError) as first:
            policy.invoke(seen, noise=("a",), candidates=1)
        assert first.value.fault is Fault.CLOSED
        running._process.wait(60)
        with pytest.raises(PolicyError, match=r"it ended with 9; its last words: out of memory"):
            policy.invoke(seen, noise=("a",), candidates=1)


def test_a_port_that_somebody_else_took_is_not_asked(entry, tmp_path, monkeypatch, serving):
    """A stranger listens where the server was told to: another port, and never the stranger."""
    with serving(lambda message: message, {"pid": "a stranger"}) as address:
        taken = int(address.rpartition(":")[2])
        ports = [taken, free_port()]
        monkeypatch.setattr(launched, "free_port", lambda: ports.pop(0))
        with Launched(entry, tmp_path) as running:
            assert metadata(running.address)["pid"] == running._process.pid
            assert running.address != address
        ports[:] = [taken] * launched.PORTS
        with pytest.raises(PolicyError, match="no process of its command"):
            Launched(entry, tmp_path)


def test_who_passes_through_a_port_is_no_server_of_ours(entry, tmp_path, monkeypatch, serving):
    """Another process tries the port for a moment: it answers, and is gone before ours listens."""
    with serving(lambda message: message, {}) as address:
        port = int(address.rpartition(":")[2])
    monkeypatch.setattr(launched, "free_port", lambda: port)
    asked = []

    def passing(address, **known):
        asked.append(address)
        if len(asked) > 1:
            return dial(address, **known)
        with serving(lambda message: message, {}) as stranger:
            return dial(stranger, **known)

    monkeypatch.setattr(launched, "dial", passing)
    # Long after the stranger, so that the moment is there.
    (tmp_path / "server.py").write_text("import time; time.sleep(1)\n" + SERVER)
    with Launched(entry, tmp_path) as running:
        assert metadata(running.address)["pid"] == running._process.pid


def test_a_port_that_was_in_use_for_a_moment_is_another_try(entry, tmp_path, monkeypatch):
    """The server ends because somebody held the port, who is not there any more."""
    used = "raise OSError(98, 'error while attempting to bind: address already in use')\n"
    script = tmp_path / "server.py"
    ports = [free_port(), free_port()]

    def given():
        script.write_text(used + SERVER if len(ports) == 2 else SERVER)
        return ports.pop(0)

    monkeypatch.setattr(launched, "free_port", given)
    with Launched(entry, tmp_path) as running:
        assert metadata(running.address)["pid"] == running._process.pid
    assert not ports


def test_a_server_that_dies_before_it_is_first_asked_says_why(entry, tmp_path, task):
    with Launched(entry, tmp_path) as running:
        running._process.kill()
        running._process.wait(60)
        with pytest.raises(PolicyError, match="it ended with -9"):
            RemotePolicy(entry, running.address, task.observation, ended=running.died)


class HangsUp(socketserver.BaseRequestHandler):
    """Speaks no WebSocket."""

    def handle(self):
        self.request.close()


def test_a_port_of_somebody_who_is_no_policy_is_left_alone(entry, tmp_path, monkeypatch):
    """The server ends, because it cannot listen there; another port is tried."""
    with socketserver.TCPServer(("127.0.0.1", 0), HangsUp) as stranger:
        thread = threading.Thread(target=stranger.serve_forever)
        thread.start()
        try:
            ports = [stranger.server_address[1], free_port()]
            monkeypatch.setattr(launched, "free_port", lambda: ports.pop(0))
            with Launched(entry, tmp_path) as running:
                assert metadata(running.address)["pid"] == running._process.pid
        finally:
            stranger.shutdown()
            thread.join()


def test_who_listens_is_known_by_its_sockets(serving):
    with serving(lambda message: message, {}) as address:
        port = int(address.rpartition(":")[2])
        assert listens(port, [os.getpid()]) is True
        assert listens(port, [os.getppid()]) is False
    assert listens(port, [os.getpid()]) is None


def test_where_processes_are_not_shown_nothing_is_known(monkeypatch, tmp_path):
    monkeypatch.setattr(processes, "PROC", tmp_path / "none")
    assert marked(launched.MARK, "x") == []
    assert listens(80, []) is None


def test_a_program_that_is_not_there(entry_of, tmp_path):
    absent = entry_of(address=None, command=["no-such-program", "{port}"])
    with pytest.raises(ConfigError, match="'no-such-program', which does not start"):
        Launched(absent, tmp_path)


def test_a_server_of_somebody_else_is_not_ended(entry, entry_of, tmp_path):
    with Launched(entry, tmp_path) as running:
        with Launched(entry_of(address=running.address), tmp_path) as other:
            assert other.address == running.address
            assert other.died() is None
        assert running.died() is None


def test_files_are_what_their_hashes_say_before_anything_starts(entry_of, tmp_path):
    weights = tmp_path / "weights.bin"
    weights.write_bytes(b"weights")
    pinned = entry_of(files={"weights.bin": sha256_file(weights)})
    verify_files(pinned, tmp_path)
    weights.write_bytes(b"weightz")
    with pytest.raises(IntegrityError, match="the entry of planted"):
        verify_files(pinned, tmp_path)
    weights.unlink()
    with pytest.raises(IntegrityError):
        verify_files(pinned, tmp_path)
