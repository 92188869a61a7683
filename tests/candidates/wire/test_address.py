"""Where a policy may listen, before anything dials."""

import pytest

from genpolicy.candidates.wire.address import check_address
from genpolicy.errors import ConfigError


@pytest.mark.parametrize("address", ["ws://127.0.0.1:80", "ws://localhost:80", "ws://[::1]:8000"])
def test_this_machine_needs_no_permission(address):
    check_address(address, None)


def test_another_machine_needs_its_name():
    with pytest.raises(ConfigError, match="another machine") as error:
        check_address("ws://10.0.0.7:8000", None)
    assert "allow_host" in error.value.action
    check_address("ws://10.0.0.7:8000", "10.0.0.7")
    with pytest.raises(ConfigError, match="another machine"):
        check_address("ws://10.0.0.8:8000", "10.0.0.7")


@pytest.mark.parametrize(
    "address", ["http://localhost:80", "wss://localhost:80", "ws://localhost", "ws://:80",
                "ws://localhost:80/path", "ws://localhost:99999999", "localhost:80", "", "ws://a..b:80",
                "ws://.:80", "ws://" + "a" * 64 + ":80"],
)  # fmt: skip
def test_what_is_no_address_is_refused(address):
    with pytest.raises(ConfigError, match="expected ws://HOST:PORT"):
        check_address(address, None)


def test_a_name_of_several_parts_is_one():
    for host in ("robot-1.lab.example.org", "a" * 63, "robot."):
        check_address(f"ws://{host}:80", host)
