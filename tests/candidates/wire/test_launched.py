import os
import sys
import time

import pytest

from genpolicy.candidates.wire.connection import dial
from genpolicy.candidates.wire.faults import Fault, PolicyError
from genpolicy.candidates.wire.launched import Launched, verify_files
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.integrity.hashing import sha256_file

SERVER = """
import os, subprocess, sys
from genpolicy.candidates.wire.connection import Listening
child = subprocess.Popen(["sleep", "600"])
print("listening", flush=True)
with Listening(lambda message: message, {"pid": os.getpid(), "child": child.pid,
                                         "here": os.getcwd()}, port=int(sys.argv[1])) as server:
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
    line = dial(address, allowed=None, timeout_s=5.0)
    line.close()
    return line.metadata


def test_it_runs_in_the_folder_of_its_entry_and_ends_with_all_that_it_started(entry, tmp_path):
    with Launched(entry, tmp_path, tmp_path / "log") as running:
        said = metadata(running.address)
        assert said["here"] == str(tmp_path)
        assert running.died() is None
        assert alive(said["pid"])
        assert alive(said["child"])
    while alive(said["pid"]) or alive(said["child"]):
        time.sleep(0.05)


def test_a_server_that_ends_at_once_is_told_with_its_last_words(entry_of, tmp_path):
    broken = entry_of(
        address=None,
        command=[sys.executable, "-c", "raise SystemExit('no weights at {port}'[:10])"],
    )
    with pytest.raises(PolicyError, match="no weights") as error:
        Launched(broken, tmp_path, tmp_path / "log")
    assert error.value.fault is Fault.CLOSED


def test_a_server_that_never_listens_is_late_and_ended(entry_of, tmp_path):
    script = "import os, time; open('pid', 'w').write(str(os.getpid())); time.sleep(600); '{port}'"
    deaf = entry_of(address=None, command=[sys.executable, "-c", script], start_timeout_s=2.0)
    with pytest.raises(PolicyError, match="does not listen after 2 s") as error:
        Launched(deaf, tmp_path, tmp_path / "log")
    assert error.value.fault is Fault.LATE
    assert not alive(int((tmp_path / "pid").read_text()))


def test_a_program_that_is_not_there(entry_of, tmp_path):
    absent = entry_of(address=None, command=["no-such-program", "{port}"])
    with pytest.raises(ConfigError, match="'no-such-program', which does not start"):
        Launched(absent, tmp_path, tmp_path / "log")


def test_a_server_of_somebody_else_is_not_ended(entry, entry_of, tmp_path):
    with Launched(entry, tmp_path, tmp_path / "log") as running:
        with Launched(entry_of(address=running.address), tmp_path, tmp_path / "other") as other:
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
