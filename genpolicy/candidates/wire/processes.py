"""Which processes of this machine belong to a server, and which of them listens: from `/proc`.

Where there is no such folder, or a process is somebody else's, nothing is known of it.
"""

import os
from contextlib import suppress
from pathlib import Path

PROC = Path("/proc")
LISTENS = "0A"
"""State of a socket in `/proc/net/tcp`."""


def marked(name: str, value: str) -> list[int]:
    """Processes that were started with this in their environment, or by one that was.

    It is inherited by every child, whatever session or parent that has meanwhile; one that clears
    its environment is not found.
    """
    sought = f"{name}={value}".encode()
    return [
        pid for pid in _processes() if sought in _read(PROC / str(pid) / "environ").split(b"\0")
    ]


def listens(port: int, processes: list[int]) -> bool | None:
    """Whether one of these processes listens on a port of IPv4; None where it cannot be known."""
    sockets = _listening(port)
    if not sockets:
        return None
    held = set()
    for pid in processes:
        with suppress(OSError):
            for entry in os.scandir(PROC / str(pid) / "fd"):
                with suppress(OSError):
                    held.add(os.readlink(entry.path))
    return any(f"socket:[{inode}]" in held for inode in sockets)


def _listening(port: int) -> list[str]:
    """Inodes of the sockets that listen there."""
    found = []
    for table in ("tcp", "tcp6"):
        for line in _read(PROC / "net" / table).decode().splitlines()[1:]:
            words = line.split()
            if words[3] == LISTENS and int(words[1].rpartition(":")[2], 16) == port:
                found.append(words[9])
    return found


def _processes() -> list[int]:
    try:
        return [int(entry.name) for entry in os.scandir(PROC) if entry.name.isdigit()]
    except OSError:
        return []


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:  # it has ended, or is somebody else's
        return b""
