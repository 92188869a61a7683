"""Which topics carry which stream; a stream that is not listed travels as plain numbers."""

from dataclasses import dataclass

from genpolicy.data.recording.episode import (
    ACTION_STREAM,
    CAMERA_STREAM,
    FORCE_STREAM,
    JOINTS_STREAM,
    ROBOT_STREAM,
)
from genpolicy.data.recording.wire import (
    GRIPPER,
    JOINTS,
    NUMBERS,
    OFFSET,
    PLANAR_POSE,
    POSE,
    WRENCH,
    Kind,
)

PHASE_TOPIC = "/phase"
PLAIN_PREFIX = "/stream/"


@dataclass(frozen=True)
class Topic:
    """A topic and the kind of its messages."""

    name: str
    kind: Kind


LAYOUT: dict[str, tuple[Topic, ...]] = {
    ROBOT_STREAM: (Topic("/robot/tcp", POSE), Topic("/robot/gripper", GRIPPER)),
    FORCE_STREAM: (Topic("/robot/wrench", WRENCH),),
    CAMERA_STREAM: (Topic("/camera/target", PLANAR_POSE), Topic("/camera/obstacle", OFFSET)),
    ACTION_STREAM: (Topic("/action/tcp", POSE), Topic("/action/gripper", GRIPPER)),
    JOINTS_STREAM: (Topic("/robot/joints", JOINTS),),
}


def topics_of(stream: str, width: int) -> tuple[Topic, ...]:
    """Topics of a stream: as listed if its width fits, else one topic of plain numbers."""
    listed = LAYOUT.get(stream, ())
    if listed and sum(topic.kind.width for topic in listed) == width:
        return listed
    return (Topic(f"{PLAIN_PREFIX}{stream}", NUMBERS),)


def stream_of(topic: str) -> tuple[str, tuple[Topic, ...]] | None:
    """Stream that a topic belongs to, with all topics of that stream; None if unknown."""
    if topic.startswith(PLAIN_PREFIX) and len(topic) > len(PLAIN_PREFIX):
        return topic[len(PLAIN_PREFIX) :], (Topic(topic, NUMBERS),)
    for stream, topics in LAYOUT.items():
        if any(topic == listed.name for listed in topics):
            return stream, topics
    return None
