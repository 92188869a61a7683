"""A candidate's entry: what somebody's policy is, where it lies, and what its numbers mean."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from genpolicy.candidates.wire.declared import DIGEST, Choice, Declared
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import read_verified, sha256_bytes

Name = Annotated[str, Field(pattern=r"^[a-z](_?[a-z0-9])*$", max_length=64)]
"""Names of files join a name and a condition by two underscores, and are parted there again."""
PORT = "{port}"
RESERVED = "genpolicy"
CPU = "cpu"
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
"""One of the unit in m."""

Column = Annotated[int, Field(ge=0, lt=4096)]
Rotation = Literal[
    "rotation_6d", "matrix", "quaternion_xyzw", "quaternion_wxyz", "rotation_vector_rad",
    "euler_xyz_rad", "euler_xyz_deg",
]  # fmt: skip
ROTATION_WIDTH = {
    "rotation_6d": 6, "matrix": 9, "quaternion_xyzw": 4, "quaternion_wxyz": 4,
    "rotation_vector_rad": 3, "euler_xyz_rad": 3, "euler_xyz_deg": 3,
}  # fmt: skip


class Input(Settings):
    """One array that the policy is given.

    Attributes:
        channels: Channels of the observation, or single numbers of them (`hole_pose.x_m`), one
            after the other.
        unit: Of lengths, as the policy wants them.
        history: How many of the last observations, oldest first. 1 gives a shape of (n,), more
            give (history, n).
        dtype: Type of the numbers.
    """

    channels: list[str] = Field(min_length=1)
    unit: Literal["m", "cm", "mm"] = "m"
    history: int = Field(default=1, ge=1, le=64)
    dtype: Literal["float32", "float64"] = "float32"


class Position(Settings):
    """Where a chunk says that the TCP shall be.

    Attributes:
        columns: Columns of x, y and z.
        unit: Of the numbers.
    """

    columns: list[Column] = Field(min_length=3, max_length=3)
    unit: Literal["m", "cm", "mm"]


class Orientation(Settings):
    """How a chunk says that the TCP shall be turned.

    Attributes:
        columns: Its columns, in the order of the form.
        form: What the numbers are. `euler_xyz`: about fixed x, then y, then z.
    """

    columns: list[Column] = Field(min_length=3, max_length=9)
    form: Rotation

    @model_validator(mode="after")
    def _as_wide_as_its_form(self) -> "Orientation":
        if len(self.columns) != ROTATION_WIDTH[self.form]:
            raise ValueError(
                f"the form {self.form} has {ROTATION_WIDTH[self.form]} columns, not "
                f"{len(self.columns)}"
            )
        return self


class Joints(Settings):
    """How a chunk says that the joints of the arm shall be.

    Attributes:
        columns: One for each joint, from the base to the hand.
        unit: Of the numbers.
    """

    columns: list[Column] = Field(min_length=1, max_length=32)
    unit: Literal["rad", "deg"]


class Gripper(Settings):
    """How far a chunk says that the gripper shall be open.

    Attributes:
        column: Its column.
        closed: The number that means closed.
        open: The number that means `open_m`.
        open_m: Distance of each finger from closed at that number, m.
    """

    column: Column
    closed: float = 0.0
    open: float
    open_m: float = Field(gt=0, le=1)

    @model_validator(mode="after")
    def _moves(self) -> "Gripper":
        if self.open == self.closed:
            raise ValueError("open and closed must differ")
        return self


class Anchor(Settings):
    """What relative actions start from: of the observation that conditioned them.

    A pose, or where they are joint positions, those.

    Attributes:
        position: Three numbers of the observation, m: a channel, or single ones.
        rotation: Six numbers of it, the first two columns of the rotation.
        joints: Measured joint positions.
    """

    position: list[str] | None = Field(default=None, min_length=1)
    rotation: list[str] | None = Field(default=None, min_length=1)
    joints: list[str] | None = Field(default=None, min_length=1)

    @model_validator(mode="after")
    def _one_kind(self) -> "Anchor":
        pose = [self.position is None, self.rotation is None]
        if pose != [self.joints is not None] * 2:
            raise ValueError("anchor names position and rotation, or joints")
        return self


class Output(Settings):
    """What the numbers of a chunk are.

    Attributes:
        key: Their name in the answer.
        frame: Frame of positions and rotations: the robot's base, or the TCP of the anchor. None
            of joints, which have none.
        motion: `absolute`; `relative` to the anchor, every row; or `increments`, each from the
            row before it, the first from the anchor.
        position: Where; None of joints.
        rotation: How turned; None of joints, and where the policy leaves the anchor's rotation as
            it is.
        joints: Positions of the arm's joints, in place of position and rotation.
        gripper: How far open.
        anchor: Where a relative motion begins; None for an absolute one.
    """

    key: str = "actions"
    frame: Literal["robot_base", "tcp"] | None = None
    motion: Literal["absolute", "relative", "increments"]
    position: Position | None = None
    rotation: Orientation | None = None
    joints: Joints | None = None
    gripper: Gripper
    anchor: Anchor | None = None

    @model_validator(mode="after")
    def _one_space(self) -> "Output":
        said = {name: getattr(self, name) is not None for name in ("frame", "position", "rotation")}
        if self.joints is not None and any(said.values()):
            raise ValueError("joints stand alone: no frame, position or rotation beside them")
        pose = said["frame"] and said["position"] and "rotation" in self.model_fields_set
        if self.joints is None and not pose:
            raise ValueError("frame, position and rotation say a pose, or joints say it")
        if self.anchor is not None and (self.anchor.joints is None) != (self.joints is None):
            raise ValueError("anchor is joint positions of a motion of joints, and of no other")
        return self

    @model_validator(mode="after")
    def _consistent(self) -> "Output":
        if self.motion == "absolute" and self.frame == "tcp":
            raise ValueError("the motion absolute is in the frame robot_base")
        if self.motion == "absolute" and self.rotation is None and self.joints is None:
            raise ValueError("the motion absolute says its rotation")
        if (self.anchor is None) != (self.motion == "absolute"):
            has = "no anchor" if self.anchor else "an anchor, the pose that it starts from"
            raise ValueError(f"the motion {self.motion} has {has}")
        if len(set(self.columns)) != len(self.columns):
            raise ValueError("each column means one thing")
        return self

    @property
    def columns(self) -> list[int]:
        """Every column that has a meaning."""
        parts = (self.position, self.rotation, self.joints)
        return [*(c for part in parts if part for c in part.columns), self.gripper.column]

    @property
    def width(self) -> int:
        """How many columns there must be at least."""
        return 1 + max(self.columns)


class Entry(Settings):
    """What every kind of candidate says of itself.

    Attributes:
        name: Its name in every table.
        kind: How it is hosted.
        author: Who made it, as an e-mail address; may not review it.
        files: What it is: path, from the entry's folder, to SHA-256. Checked before it starts.
        horizons: H_o, K, H_e and the period of an action.
        observation: What it is given, by the name on the wire.
        constants: What it is given besides, unchanged: a prompt, the number of a robot.
        action: What its chunks mean.
        stochastic: Whether the candidates of one observation differ; else one is drawn.
        declared: What the identity card of Gate B asks for; without it the gate fails by name.
        samplers: Other settings that may be asked of it, by the names that its server knows them
            by. They are measured beside the judged one, and decide nothing.
        start_timeout_s: How long it may take to listen.
        timeout_s: How long an answer is waited for before it counts as none.
    """

    name: Name
    kind: str
    author: str = Field(pattern=r"^[^@\s]+@[^@\s]+$")
    files: dict[str, Annotated[str, Field(pattern=DIGEST)]] = Field(default_factory=dict)
    horizons: HorizonConfig
    observation: dict[str, Input] = Field(min_length=1)
    constants: dict[str, str | int | float | bool] = Field(default_factory=dict)
    action: Output
    stochastic: bool = True
    declared: Declared | None = None
    samplers: dict[Name, Choice] = Field(default_factory=dict)
    start_timeout_s: float = Field(default=60.0, gt=0, le=600)
    timeout_s: float = Field(default=2.0, gt=0, le=60)

    @model_validator(mode="after")
    def _given_once(self) -> "Entry":
        if twice := sorted(set(self.observation) & set(self.constants)):
            raise ValueError(f"{twice[0]} is given twice")
        if RESERVED in {**self.observation, **self.constants}:
            raise ValueError(f"{RESERVED} is the word of what is asked beside the observation")
        for name, value in self.constants.items():
            if isinstance(value, int) and not -(2**63) <= value < 2**63:
                raise ValueError(f"{name} is {value}, and a message holds integers of 64 bits")
        return self

    @property
    def sha256(self) -> str:
        """Of all that it says, the hashes of its files among it."""
        said = self.model_dump(mode="json")
        if not self.samplers:  # an entry without any is who it was before there were some
            del said["samplers"]
        return sha256_bytes(canonical_json(said))

    @property
    def device(self) -> str:
        """Where it runs, as its maker declares; the CPU where nothing is declared."""
        return self.declared.device if self.declared else CPU

    @property
    def started_here(self) -> bool:
        """Whether its server is started and ended here."""
        return True

    def essential(self, folder: Path) -> list[str]:
        """Files that are the candidate, so that `files` must name them; paths as there."""
        return []

    def require_host(self) -> None:
        """Refuse a candidate that nothing on this machine can run.

        Raises:
            ConfigError: A library or an interpreter is not there.
        """


class ServerEntry(Entry):
    """A policy behind a server that speaks the wire protocol.

    Attributes:
        kind: `server`.
        address: Of one that runs already, `ws://host:port`.
        allow_host: Another machine that observations may be sent to; loopback needs none.
        command: Of one that is started, watched and ended here; `{port}` stands for its port.
    """

    kind: Literal["server"]
    address: str | None = None
    allow_host: str | None = None
    command: list[str] | None = Field(default=None, min_length=1)

    @property
    def started_here(self) -> bool:
        """Whether it has a command; else it runs already."""
        return self.command is not None

    @model_validator(mode="after")
    def _reachable(self) -> "ServerEntry":
        if (self.address is None) == (self.command is None):
            raise ValueError("address or command: one of them says where it is")
        if self.command is not None and not any(PORT in word for word in self.command):
            raise ValueError(f"command tells the server its port: write {PORT} where it stands")
        return self


def verify_files(entry: Entry, folder: Path) -> None:
    """Hold every file that is the candidate against its hash.

    Args:
        entry: What it is.
        folder: Of the entry's file; paths in it start there.

    Raises:
        ConfigError: A file that is the candidate has no hash.
        IntegrityError: A file is missing, or is another one.
    """
    for name in entry.essential(folder):
        if name not in entry.files:
            raise ConfigError(
                where=f"files of the candidate {entry.name}",
                found=f"without {name}, which is a part of it",
                expected=f"the SHA-256 of each file that a candidate of kind {entry.kind} is",
                action=f"Write `{name}: <sha256>` into `files`.",
            )
    for name, digest in sorted(entry.files.items()):
        read_file(entry, folder, name, digest)


def read_file(entry: Entry, folder: Path, name: str, sha256: str) -> bytes:
    """A file of a candidate, verified; no stage writes it, so that its author is told what to do.

    Raises:
        IntegrityError: It is missing, a link, or another one.
    """
    path = folder / name
    try:
        return read_verified(path, sha256=sha256, named_by=f"the entry of {entry.name}")
    except IntegrityError as error:
        action = f"Restore it, or write the hash of what it is now into `files` ({name})."
        if path.is_symlink():
            action = "Copy it with `cp -rL`, which follows links, and name the copy in the entry."
        elif not path.exists():
            action = f"Put it there, or take `{name}` out of `files`."
        raise IntegrityError(
            where=error.where, found=error.found, expected=error.expected, action=action
        ) from error
