"""The kinds of a candidate beside `server`: what lies on the disk, and is hosted in a child."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError, model_validator

from genpolicy.candidates.hosts.onnx_library import require_onnx
from genpolicy.candidates.wire.address import check_address
from genpolicy.candidates.wire.declared import DIGEST, Choice
from genpolicy.candidates.wire.entry import CPU, Entry, ServerEntry
from genpolicy.candidates.wire.parsing import parse_entry
from genpolicy.contract.settings import Settings, parse_settings
from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import read_yaml
from genpolicy.policies.settings import SamplerConfig

FUNCTION = r"^[A-Za-z_][A-Za-z0-9_]*:[A-Za-z_][A-Za-z0-9_]*$"
CHECKPOINT_FILES = ("config.json", "model.safetensors")
TRAINING_RECORD = "train_config.json"
"""LeRobot's record of a training, which its policy never reads."""

Size = Annotated[int, Field(ge=1, le=4096)]


class Noise(Settings):
    """Standard normal numbers that a candidate draws from, by the name of the invocation.

    Attributes:
        input: Its name among the inputs.
        shape: Of one draw.
        steps: How many draws, one after the other in a first axis; None for one without that axis.
        stream: What the names of the draws begin with; None for the hash of its files. An export
            of a checkpoint has the checkpoint's hash, so that both draw the same numbers.
    """

    input: str = Field(min_length=1)
    shape: list[Size] = Field(min_length=1, max_length=4)
    steps: Size | None = None
    stream: str | None = Field(default=None, pattern=DIGEST)

    @property
    def whole_shape(self) -> tuple[int, ...]:
        """Shape of the input."""
        return (*([] if self.steps is None else [self.steps]), *self.shape)


class HostedEntry(Entry):
    """What is run by our own code in a child.

    Attributes:
        threads: Of its arithmetic.
    """

    threads: int = Field(default=1, ge=1, le=256)

    @model_validator(mode="after")
    def _as_declared(self) -> "HostedEntry":
        if self.declared is not None and self.declared.threads != self.threads:
            raise ValueError(
                f"threads is {self.threads}, declared.threads {self.declared.threads}; it is one "
                "number"
            )
        return self


class TrainedEntry(HostedEntry):
    """A checkpoint of ours.

    Attributes:
        kind: `trained`.
        checkpoint: Its folder.
    """

    kind: Literal["trained"]
    checkpoint: str = Field(min_length=1)
    threads: Literal[1] = 1

    @model_validator(mode="after")
    def _asked_as_it_is(self) -> "TrainedEntry":
        if list(self.observation) != ["observation"] or self.constants:
            raise ValueError("a checkpoint is given one input, which is named observation")
        given = self.observation["observation"]
        if (given.dtype, given.unit) != ("float64", "m"):
            raise ValueError("a checkpoint is given float64 numbers, lengths in m")
        if given.history != self.horizons.observation_horizon:
            raise ValueError(
                f"a checkpoint is given its {self.horizons.observation_horizon} last observations, "
                f"not {given.history}"
            )
        return self

    def essential(self, folder: Path) -> list[str]:
        """Weights and config."""
        return [_below(self.checkpoint, name) for name in CHECKPOINT_FILES]

    def require_host(self) -> None:
        """The device that it declares."""
        from genpolicy.policies.determinism import require_device  # noqa: PLC0415  (loads torch)

        require_device(self.device, where=f"declared.device of the candidate {self.name}")


class DrawingEntry(HostedEntry):
    """What is a function of its inputs, noise among them.

    Attributes:
        noise: What it draws from; None of one that draws nothing.
    """

    noise: Noise | None = None

    @model_validator(mode="after")
    def _draws_what_it_is_given(self) -> "DrawingEntry":
        if self.stochastic != (self.noise is not None):
            raise ValueError(
                "stochastic: true needs `noise`, and false none: candidates differ by nothing else"
            )
        if self.noise is not None and self.noise.input in {**self.observation, **self.constants}:
            raise ValueError(f"{self.noise.input} is given twice")
        return self


class Encoder(Settings):
    """The part of a program that looks at the observation, apart, so that its time is known.

    Attributes:
        program: Its file. It is given the inputs of `observation`, and gives one array.
        gives: Name of that array among the inputs of the program behind it, whose only other
            input is the noise.
    """

    program: str = Field(min_length=1)
    gives: str = Field(min_length=1)


class ProgramEntry(DrawingEntry):
    """A program in a file: named arrays in, one chunk out.

    Attributes:
        program: Its file, from the entry's folder.
        encoder: What runs before it, once for all candidates; None where it is one program.
        counted_weight: A weight that each evaluation of the network uses once; how often the
            program uses it is its number of evaluations. None: nobody can count.
    """

    program: str = Field(min_length=1)
    encoder: Encoder | None = None
    counted_weight: str | None = None

    @model_validator(mode="after")
    def _arrays_only(self) -> "ProgramEntry":
        if self.constants:
            raise ValueError("a program is given arrays of the observation and noise, no constants")
        if self.samplers:
            raise ValueError("samplers: a program is written out with one; bring another program")
        return self

    @model_validator(mode="after")
    def _on_the_cpu(self) -> "ProgramEntry":
        if self.device != CPU:
            raise ValueError(
                f"declared.device is {self.device}; programs run on the {CPU} here: serve it by a "
                "command of your own (kind server)"
            )
        return self

    def essential(self, folder: Path) -> list[str]:
        """Its programs."""
        return [self.program, *([self.encoder.program] if self.encoder else [])]


class TorchEntry(ProgramEntry):
    """A program of `torch.export`."""

    kind: Literal["torch"]


class OnnxEntry(ProgramEntry):
    """An ONNX file, run by ONNX Runtime on the CPU."""

    kind: Literal["onnx"]

    def require_host(self) -> None:
        """The libraries of the extra."""
        require_onnx("onnx", "onnxruntime")


class ScriptedEntry(DrawingEntry):
    """A Python function: a planner, a replay, whatever a policy is held against.

    Attributes:
        kind: `scripted`.
        function: `module:name`, in `module.py` beside the entry. It is called with the map of
            the inputs, and gives a chunk.
    """

    kind: Literal["scripted"]
    function: str = Field(pattern=FUNCTION)

    @model_validator(mode="after")
    def _as_it_is(self) -> "ScriptedEntry":
        if self.samplers:
            raise ValueError("samplers: a function has no settings to ask for; bring another one")
        return self

    @property
    def file(self) -> str:
        """Where the function stands."""
        return f"{self.function.partition(':')[0]}.py"

    def essential(self, folder: Path) -> list[str]:
        """The module; what it imports is installed, or not found."""
        return [self.file]


class LeRobotEntry(Entry):
    """A `pretrained_model` folder of LeRobot, run by LeRobot's own code in its own environment.

    Attributes:
        kind: `lerobot`.
        pretrained_model: The folder.
        interpreter: Python that has LeRobot, from the root of the workspace.
    """

    kind: Literal["lerobot"]
    pretrained_model: str = Field(min_length=1)
    interpreter: str = "build/lerobot/bin/python"

    @model_validator(mode="after")
    def _as_it_was_saved(self) -> "LeRobotEntry":
        if self.samplers:
            raise ValueError(
                "samplers: a policy of LeRobot is asked as its config.json says; bring another "
                "folder"
            )
        return self

    def essential(self, folder: Path) -> list[str]:
        """Config and weights, and whatever else of it LeRobot reads."""
        place = folder / self.pretrained_model
        read = [*place.glob("*.json"), *place.glob("*.safetensors")]
        names = {path.name for path in read} - {TRAINING_RECORD} | set(CHECKPOINT_FILES)
        return [_below(self.pretrained_model, name) for name in sorted(names)]

    def require_host(self) -> None:
        """Its interpreter, and the device that it declares."""
        from genpolicy.policies.determinism import require_device  # noqa: PLC0415  (loads torch)

        require_device(self.device, where=f"declared.device of the candidate {self.name}")
        if not Path(self.interpreter).is_file():
            raise ConfigError(
                where=f"interpreter of the candidate {self.name}",
                found=f"{self.interpreter}, which is not there",
                expected="a Python that has LeRobot",
                action="Run `make lerobot`, or name another `interpreter`.",
            )


KINDS: dict[str, type[Entry]] = {
    "server": ServerEntry,
    "trained": TrainedEntry,
    "torch": TorchEntry,
    "onnx": OnnxEntry,
    "lerobot": LeRobotEntry,
    "scripted": ScriptedEntry,
}


def read_entry(path: Path) -> Entry:
    """The entry of a file.

    Raises:
        ConfigError: No readable YAML, an unknown kind, a field that is missing or wrong, or an
            address that is none or of a machine that nobody allowed.
    """
    values = read_yaml(path)
    if not isinstance(values, dict):
        raise ConfigError(
            where=str(path),
            found="no map of settings",
            expected="the fields of a candidate",
            action="See docs/candidates.md.",
        )
    kind = values.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        raise ConfigError(
            where=f"{path}.kind",
            found=repr(kind)[:80],
            expected=f"one of {', '.join(KINDS)}",
            action="See docs/candidates.md.",
        )
    entry = parse_entry(KINDS[kind], values, where=str(path))
    if isinstance(entry, ServerEntry) and entry.address is not None:
        check_address(entry.address, entry.allow_host, where=f"{path}.address")
    if isinstance(entry, TrainedEntry) and entry.samplers:
        _require_settings(entry, path)
    return entry


def chosen(own: SamplerConfig, choice: Choice, *, where: str) -> SamplerConfig:
    """The settings that a choice asks for.

    What a choice can say and does not has its default, never that of the judged sampler; what it
    cannot say (`clip`, `population`, `batch_rows`) stays as the checkpoint has it.

    Raises:
        ConfigError: No sampler of ours.
    """
    said = choice.model_dump(exclude={"sampler", "sampler_steps"}, exclude_none=True)
    kept = own.model_dump(include={"clip", "population", "batch_rows"})
    said |= {"name": choice.sampler, "steps": choice.sampler_steps}
    return parse_settings(SamplerConfig, kept | said, where=where)


def _require_settings(entry: TrainedEntry, path: Path) -> None:
    """Refuse a setting that its checkpoint cannot have, before a host dies of it."""
    from genpolicy.policies.checkpoint import CheckpointConfig  # noqa: PLC0415  (loads torch)
    from genpolicy.policies.methods import check_sampler, method_named  # noqa: PLC0415  (likewise)

    file = path.parent / entry.checkpoint / CHECKPOINT_FILES[0]
    if not file.is_file():
        return  # refused by name where files are verified
    try:
        config = CheckpointConfig.model_validate_json(file.read_bytes())
    except ValidationError:
        return  # refused by name where it is loaded
    for name, choice in entry.samplers.items():
        where = f"{path}: samplers.{name}"
        sampler = chosen(config.sampler, choice, where=where)
        try:
            check_sampler(method_named(config.method), sampler, config.head)
        except ConfigError as error:
            raise ConfigError(
                where=where, found=f"{error.found} ({error.where})", expected=error.expected,
                action=error.action,
            ) from error  # fmt: skip


def _below(folder: str, name: str) -> str:
    """A file of a folder as `files` names it: `./a/` and `a` are one."""
    return (Path(folder) / name).as_posix()
