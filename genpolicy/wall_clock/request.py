"""What a run on a wall clock is asked to do: one document in the folder of the run."""

from pathlib import Path

from pydantic import Field, ValidationError

from genpolicy.contract.settings import Settings
from genpolicy.errors import ConfigError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.hashing import sha256_bytes_of
from genpolicy.wall_clock.messages import LONGEST_NAME
from genpolicy.wall_clock.replay import Replay

REQUEST = "request.json"
OUTCOME = "outcome.json"
"""What the supervisor's process says of itself at its end."""


class WallClockRequest(Settings):
    """One run.

    Attributes:
        root: Workspace with the pinned limits.
        method: Name of the method, in the journal's labels.
        checkpoint: Weights that may command; chunks of others are discarded.
        sampler: Sampler settings that may.
        replay: The recorded episode.
        then: Further ones, each a session of its own that begins like the first of a folder.
    """

    root: str
    method: str = Field(max_length=LONGEST_NAME)
    checkpoint: str = Field(max_length=LONGEST_NAME)
    sampler: str = Field(max_length=LONGEST_NAME)
    replay: Replay
    then: tuple[Replay, ...] = ()

    def write(self, folder: Path) -> None:
        """Put it into the folder of a run.

        Raises:
            BadInputError: The place cannot be written.
        """
        write_bytes(folder / REQUEST, self.model_dump_json().encode())


def read_request(folder: Path) -> WallClockRequest:
    """What a run is asked to do.

    Raises:
        IntegrityError: No such document.
        ConfigError: It is none.
    """
    _, data = sha256_bytes_of(folder / REQUEST, keep=True)
    try:
        return WallClockRequest.model_validate_json(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise ConfigError(
            where=".".join([REQUEST, *(str(part) for part in first["loc"])]),
            found=repr(first.get("input"))[:120],
            expected=first["msg"],
            action="Begin the run again with `genpolicy shadow`.",
        ) from error
