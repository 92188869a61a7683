"""`genpolicy serve-policy` and `serve-candidate`: the process in which a policy runs."""

from pathlib import Path

from genpolicy.candidates.hosts.hosted import Served
from genpolicy.candidates.hosts.serving import hosted
from genpolicy.candidates.judged import loaded_on
from genpolicy.candidates.wire.connection import LOOPBACK, Listening
from genpolicy.candidates.wire.served import ServedPolicy
from genpolicy.errors import ConfigError
from genpolicy.policies.determinism import require_device

INTERRUPTED = 130


def run_serve(checkpoint: Path, *, port: int, sha256: str | None, device: str) -> int:
    """Serve a checkpoint on this machine until an interrupt. Returns the exit code.

    Raises:
        ConfigError: Nobody may listen on that port, or this machine has no such device.
        BadInputError: The checkpoint is missing, malformed, or another one.
    """
    require_device(device, where="--device")
    policy = loaded_on(device, checkpoint, sha256=sha256)
    return _listen(ServedPolicy(policy), policy.method, port)


def run_host(
    path: Path, *, port: int, sha256: str | None, widths: list[str], threads: int | None,
    observation: str | None = None, only_loaded: bool = False,
) -> int:  # fmt: skip
    """Serve what an entry names on this machine until an interrupt. Returns the exit code.

    With `only_loaded` it ends where it would begin to listen.

    Raises:
        ConfigError: Nobody may listen on that port, or a width that is none.
        BadInputError: The entry or a file of it is missing, wrong, or another one.
    """
    known = dict(_width(said) for said in widths)
    served = hosted(path, sha256=sha256, widths=known, threads=threads, observation=observation)
    if only_loaded:
        return 0
    return _listen(served, str(path), port)


def _width(said: str) -> tuple[str, int]:
    name, _, number = said.rpartition("=")
    if not name or not number.isdecimal():
        raise ConfigError(
            where="--width",
            found=repr(said),
            expected="NAME=NUMBER, as observation=34",
            action="Leave it out: what the wire brings is looked at in any case.",
        )
    return name, int(number)


def _listen(served: Served, what: str, port: int) -> int:
    try:
        listening = Listening(served.answer, served.metadata, port=port)
    except OSError as error:
        raise ConfigError(
            where="--port",
            found=f"{port}, on which nobody can listen ({error.strerror})",
            expected="a free port of this machine",
            action="Name another one, or 0 for any.",
        ) from error
    print(f"Serving {what} at ws://{LOOPBACK}:{listening.port}", flush=True)
    with listening:
        try:
            listening.serve_forever()
        except KeyboardInterrupt:
            return INTERRUPTED
    return 0
