"""Where a policy's process listens: on this machine, or where a person allows it. Opens nothing."""

import ipaddress
import re

from genpolicy.errors import ConfigError

LABEL = r"[A-Za-z0-9-]{1,63}"
"""A part of a host's name: of an empty or a longer one the socket's library raises an error."""
HOST = rf"\[[0-9A-Fa-f:.]+\]|{LABEL}(?:\.{LABEL})*\.?"
ADDRESS = re.compile(rf"ws://(?P<host>{HOST}):(?P<port>\d{{1,5}})/?")
LAST_PORT = 65535
PLACE = "address of a policy's process"


def check_address(address: str, allowed: str | None, *, where: str = PLACE) -> None:
    """Refuse an address that is neither on this machine nor allowed by name.

    Args:
        address: `ws://host:port`.
        allowed: A host that a person has named besides; None for none.
        where: The place of it, for the error text.

    Raises:
        ConfigError: No such address, or another machine's.
    """
    parts = ADDRESS.fullmatch(address)
    if parts is None or int(parts["port"]) > LAST_PORT:
        raise ConfigError(
            where=where,
            found=repr(address),
            expected="ws://HOST:PORT",
            action="Name host and port.",
        )
    host = parts["host"].strip("[]")
    if not (_is_loopback(host) or host == allowed):
        raise ConfigError(
            where=where,
            found=f"{host}, another machine",
            expected="this machine, or a host that `allow_host` names",
            action="Name the host in `allow_host` if observations may be sent to it.",
        )


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
