"""One recorded episode in memory: streams with their own clocks, phase events, metadata.

Event time (when the sensor was exposed, on the sensor's clock) and receive time (when the host
received the sample, on the host's clock) are kept apart. The sensor's clock minus the host's
clock is declared in the metadata, `clock_offset_<stream>_ns`; nothing here removes it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ContractError

Array = NDArray[np.float64]
Times = NDArray[np.int64]

ROBOT_STREAM = "robot"
FORCE_STREAM = "force"
CAMERA_STREAM = "camera"
ACTION_STREAM = "action"
PHASE_STREAM = "phase"
JOINTS_STREAM = "joints"

OUTCOMES = ("success", "failure")
NOT_RECORDED = "not_recorded"
REQUIRED_METADATA = (
    "task",
    "object",
    "operator",
    "calibration_epoch",
    "outcome",
    "is_recovery",
    "is_intervention",
    "scene_start",
    "robot",
)


def clock_offset_key(stream: str) -> str:
    """Metadata key of a stream's declared clock offset: sensor clock minus host clock, ns."""
    return f"clock_offset_{stream}_ns"


@dataclass(frozen=True)
class StreamSamples:
    """The samples of one stream, in the order of the sensor.

    Attributes:
        stream: Name of the stream.
        event_time_ns: When each sample was exposed, on the stream's own clock, ns. Shape (n,).
        receive_time_ns: When the host received it, on the host's clock, ns. Shape (n,).
        values: Samples, SI units. Shape (n, width).
    """

    stream: str
    event_time_ns: Times
    receive_time_ns: Times
    values: Array

    def __post_init__(self) -> None:
        for name, dtype, axes in (
            ("event_time_ns", np.int64, 1),
            ("receive_time_ns", np.int64, 1),
            ("values", np.float64, 2),
        ):
            array = np.array(getattr(self, name), dtype=dtype)
            if array.ndim != axes or len(array) != len(self.event_time_ns):
                raise ContractError(
                    where=f"stream {self.stream}: {name}",
                    found=f"of shape {array.shape}",
                    expected=f"{axes} axes and {len(self.event_time_ns)} rows",
                    action="Deliver one row per sample.",
                )
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.event_time_ns)


@dataclass(frozen=True)
class RecordedEpisode:
    """One demonstration, as recorded.

    Attributes:
        episode_uuid: Lower-case UUID.
        streams: Samples by stream: `robot` (tcp position m 3, rotation columns 6, gripper opening
            m 1), `force` (N, 3), `camera` (target x m, y m, cos yaw, sin yaw, obstacle y m),
            `action` (10); optionally `joints` (rad) and any other, as plain numbers.
        phase_events: (event_time_ns, receive_time_ns, phase), one per change of phase.
        metadata: `REQUIRED_METADATA` (booleans as `true` / `false`, `scene_start` as JSON),
            `clock_offset_<stream>_ns` of every stream, and what else names the recording.
    """

    episode_uuid: str
    streams: dict[str, StreamSamples]
    phase_events: tuple[tuple[int, int, str], ...]
    metadata: dict[str, str]
