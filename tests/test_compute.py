"""Fan-out: order, workers, and no need of sockets."""

import os
import subprocess
import sys

import pytest

from genpolicy.compute import LOCAL, map_shards


def square(value):
    return value * value, os.getpid()


def fail(value):
    if value == 2:
        raise ValueError(f"shard {value}")
    return value


def test_one_worker_runs_here_and_in_order():
    results = map_shards(square, [3, 1, 2], workers=1, scheduler=LOCAL)
    assert [value for value, _ in results] == [9, 1, 4]
    assert {pid for _, pid in results} == {os.getpid()}
    assert map_shards(square, [], workers=2, scheduler=LOCAL) == []


def test_a_single_shard_starts_no_process():
    assert map_shards(square, [5], workers=4, scheduler=LOCAL) == [(25, os.getpid())]


# Top-level functions of an installed module: what the workers import must be importable there.
PROGRAM = """
import math, socket

def refusing(function):
    def refuse(self, *args):
        if self.family != socket.AF_UNIX:  # a file of this machine is no network
            raise OSError("no network here")
        return function(self, *args)
    return refuse

class NoNetwork(socket.socket):
    bind, connect = refusing(socket.socket.bind), refusing(socket.socket.connect)

if __name__ == "__main__":
    socket.socket = NoNetwork
    try:
        socket.socket().bind(("127.0.0.1", 0))
    except OSError as error:
        print(error)
    from genpolicy.compute import map_shards
    values = [9.0, 4.0, 1.0, 16.0, 25.0]
    two = map_shards(math.sqrt, values, workers=2, scheduler="local")
    one = map_shards(math.sqrt, values, workers=1, scheduler="local")
    assert two == one == [3.0, 2.0, 1.0, 4.0, 5.0], (one, two)
    try:
        map_shards(math.sqrt, [1.0, -1.0], workers=2, scheduler="local")
    except ValueError as error:
        print("raised", error)
"""


def test_two_workers_give_the_same_in_order_without_a_network(tmp_path):
    script = tmp_path / "program.py"
    script.write_text(PROGRAM)
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["no network here", "raised math domain error"]


def test_an_error_in_a_shard_is_raised_not_swallowed():
    with pytest.raises(ValueError, match="shard 2"):
        map_shards(fail, [1, 2, 3], workers=1, scheduler=LOCAL)


IMPORTED = """
import sys

def there(name):
    return name in sys.modules

if __name__ == "__main__":
    import genpolicy.seeds
    from genpolicy.compute import map_shards
    assert there("genpolicy.seeds")
    print(map_shards(there, ["genpolicy.seeds"] * 2, workers=2, scheduler="local"))
"""


def test_workers_find_imported_what_is_imported_here(tmp_path):
    script = tmp_path / "program.py"
    script.write_text(IMPORTED)
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "[True, True]\n"), done.stderr
