"""`identity.json` of the stage `task`: which task a measurement is one of."""

from dataclasses import dataclass

from genpolicy.documents.document import Document

Point = tuple[float, float, float]


@dataclass(frozen=True)
class TaskIdentity:
    """Everything that makes a measurement one of this task.

    Attributes:
        name: Registered name.
        entry_point: Where it is registered.
        distribution: Name and version of what installed it.
        package: SHA-256 of each file of its package.
        scene: SHA-256 of each file beside a scene that lies outside the package.
        scene_sha256: Of the scene.
        observation_sha256: Of the observation contract.
        action_sha256: Of the action contract.
        phases: By their meaning.
        obstacles: Bodies that stand in the way.
        workspace_m: Lower and upper corner, base frame, m.
        robot: Name of the robot.
        robot_sha256: Of its table of limits.
        sha256: Over all of that.
    """

    name: str
    entry_point: str
    distribution: dict[str, str]
    package: dict[str, str]
    scene: dict[str, str]
    scene_sha256: str
    observation_sha256: str
    action_sha256: str
    phases: dict[str, list[str]]
    obstacles: list[str]
    workspace_m: tuple[Point, Point]
    robot: str
    robot_sha256: str
    sha256: str

    @property
    def every_phase(self) -> list[str]:
        """All phases of the task; none where the task does not say."""
        return self.phases.get("all", [])


IDENTITY = Document("identity.json", TaskIdentity)
