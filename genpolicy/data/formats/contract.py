"""`contract.yaml`: how the columns of somebody's recordings become observations and actions.

The one document that a person reads and corrects: what was recorded, in which unit, what of it
was only guessed, and what nobody recorded. Nothing outside it decides how data are read.
"""

import re
from dataclasses import dataclass, replace
from math import pi
from pathlib import Path
from typing import Any, Literal, NoReturn

import yaml
from pydantic import Field

from genpolicy.contract.observation import Channel, ObservationContract
from genpolicy.contract.settings import Settings, parse_settings
from genpolicy.data.contract import TCP_ACTION, ActionContract
from genpolicy.data.formats.commands import CommandForm, check_commands
from genpolicy.data.recording.episode import JOINTS_STREAM
from genpolicy.errors import ConfigError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import read_yaml

Format = Literal["mcap", "zarr", "lerobot", "robomimic", "parquet", "dataset"]

UNKNOWN_UNIT = "unknown"
SI = {"mm": ("m", 1e-3), "cm": ("m", 1e-2), "deg": ("rad", pi / 180.0)}
MAXIMUM_WIDTH = 4096
_SELECTOR = re.compile(r"(?P<name>[^\[\]\s]+)(\[(?P<first>\d{1,4})(:(?P<stop>\d{1,4}))?\])?")
HEADER = (
    "# How these recordings become observations and actions. Correct what was guessed\n"
    "# (`guessed: true`), name what was recorded (`labels`), then give this file to\n"
    "# `genpolicy ingest` or `genpolicy audit` with --contract. null: not recorded.\n"
)


@dataclass(frozen=True)
class Selector:
    """One number of a source column: a scalar column, or an element of a vector column."""

    column: str
    element: int | None


class ChannelSource(Settings):
    """One observation channel and the columns that it is made of.

    Attributes:
        name: Name in the dataset.
        columns: Source columns, `state[0:3]`, `state[4]` or `x`, one number per component (one
            per two components for `cos_sin`).
        components: Name of each number.
        unit: As recorded; mm, cm and deg become m and rad. `unknown` where nothing told it.
        guessed: The unit was guessed.
        stream: The sensor, with its own clock.
        transform: `cos_sin` writes an angle as cosine and sine, free of its jump.
        maximum_age_s: Oldest sample that may still condition an action, s.
    """

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")
    columns: list[str] = Field(min_length=1)
    components: list[str] = Field(min_length=1)
    unit: str = Field(min_length=1)
    guessed: bool = False
    stream: str = Field(min_length=1)
    transform: Literal["none", "cos_sin"] = "none"
    maximum_age_s: float = Field(default=0.5, gt=0)

    @property
    def dataset_unit(self) -> str:
        """Unit in the dataset."""
        return "1" if self.transform == "cos_sin" else SI.get(self.unit, (self.unit, 1.0))[0]

    @property
    def factor(self) -> float:
        """Recorded number to dataset number."""
        return SI.get(self.unit, (self.unit, 1.0))[1]


class ActionSource(Settings):
    """The action and the columns that it is made of; see `ChannelSource`.

    Attributes:
        frame: Frame that the numbers are expressed in.
        units: As recorded, one per component.
        guessed: The units were guessed.
    """

    columns: list[str] = Field(min_length=1)
    components: list[str] = Field(min_length=1)
    units: list[str] = Field(min_length=1)
    guessed: bool = False
    frame: str = "not_recorded"


class Labels(Settings):
    """Columns that say more of a row or of its episode; null is "not recorded".

    Attributes:
        episode: Which episode a row belongs to; null where the layout says it.
        frame: Number of the row in its episode; a gap refuses the episode.
        time: When the row was recorded, in `time_unit`.
        task, object, operator, calibration_epoch, outcome: One value per episode.
        phase: One value per row.
        is_recovery, is_intervention: One truth value per episode.
    """

    episode: str | None = None
    frame: str | None = None
    time: str | None = None
    task: str | None = None
    phase: str | None = None
    object: str | None = None
    operator: str | None = None
    calibration_epoch: str | None = None
    outcome: str | None = None
    is_recovery: str | None = None
    is_intervention: str | None = None

    def named(self) -> dict[str, str]:
        """The labels that are recorded, with their columns."""
        return {name: column for name, column in self.model_dump().items() if column is not None}


class Frozen(Settings):
    """A stream bit-constant for `seconds` while the action moves by `motion` is frozen.

    Attributes:
        streams: Streams that must change while the action moves.
        seconds: How long, s.
        motion: How far a component of the action moves meanwhile, in its unit.
    """

    streams: list[str] = Field(min_length=1)
    seconds: float = Field(gt=0)
    motion: float = Field(gt=0)


class ImportContract(Settings):
    """How recordings of one layout become a dataset.

    Attributes:
        format: Layout of the recordings.
        task: Name of the task, where no column says it.
        rate_hz: Rows per second.
        rate_guessed: Neither metadata nor a clock gave the rate.
        channels: The observation.
        action: The action.
        pairing: Component of the action to `channel.component` that it commands; null where
            they have nothing in common (a leader of another build, or what it moves unseen).
        pairing_guessed: The pairing was found in the numbers, not in the names.
        forms: What each component of the action means: a place, a change, a rate. One that is not
            listed is a place in the unit of what it commands.
        forms_guessed: The forms were found in the numbers.
        labels: Columns of labels and clocks.
        time_unit: Unit of the time column.
        time_origin: `episode` where the clock begins anew with every episode.
        phases: Known phases, in order; null takes those that occur.
        ranges: Plausible values by `channel.component` and `action.component`, dataset units.
        joint_range_rad: Lower and upper joint limits, for recordings with a stream `joints`.
        minimum_rows: A shorter episode is no demonstration.
        maximum_gap_s: Longest time between two rows.
        frozen: When a sensor counts as frozen; null does not look.
        audit: Settings of the audit that differ from its defaults.
        notes: What was guessed, found contradictory or not recorded, a sentence each.
    """

    format: Format
    task: str = Field(min_length=1)
    rate_hz: float = Field(gt=0, le=100_000)
    rate_guessed: bool = False
    channels: list[ChannelSource] = Field(min_length=1)
    action: ActionSource
    pairing: dict[str, str] | None = None
    pairing_guessed: bool = False
    forms: dict[str, CommandForm] = Field(default_factory=dict)
    forms_guessed: bool = False
    labels: Labels = Labels()
    time_unit: Literal["s", "ms", "us", "ns"] = "s"
    time_origin: Literal["episode", "recording"] = "episode"
    phases: list[str] | None = None
    ranges: dict[str, list[float]] = Field(default_factory=dict)
    joint_range_rad: list[list[float]] | None = None
    minimum_rows: int = Field(default=2, ge=2)
    maximum_gap_s: float = Field(default=1.0, gt=0)
    frozen: Frozen | None = None
    audit: dict[str, Any] = Field(default_factory=dict)
    notes: list[str] = Field(default_factory=list)

    @property
    def period_s(self) -> float:
        """Time between two rows, s."""
        return 1.0 / self.rate_hz

    @property
    def observation(self) -> ObservationContract:
        """The observation of the dataset."""
        return ObservationContract(
            tuple(
                Channel(c.name, tuple(c.components), c.dataset_unit, c.stream, c.maximum_age_s)
                for c in self.channels
            )
        )

    @property
    def action_contract(self) -> ActionContract:
        """The action of the dataset."""
        units = tuple(SI.get(unit, (unit, 1.0))[0] for unit in self.action.units)
        action = ActionContract(self.action.frame, tuple(self.action.components), units)
        # The project's own action carries a hash with a version; it must stay recognisable.
        return TCP_ACTION if replace(TCP_ACTION, sha256=action.sha256) == action else action


def selectors(columns: list[str], *, where: str) -> list[Selector]:
    """The numbers that `columns` name, ranges spelled out.

    Raises:
        ConfigError: One of them is not of the form `name`, `name[i]` or `name[i:j]`.
    """
    result: list[Selector] = []
    for text in columns:
        match = _SELECTOR.fullmatch(text)
        if match is None:
            _refuse(where, repr(text)[:80], "`name`, `name[2]` or `name[0:3]`")
        name, first, stop = match["name"], match["first"], match["stop"]
        if first is None:
            result.append(Selector(name, None))
            continue
        last = int(first) + 1 if stop is None else int(stop)
        if not int(first) < last <= MAXIMUM_WIDTH:
            _refuse(where, repr(text)[:80], f"a rising range of at most {MAXIMUM_WIDTH}")
        result += [Selector(name, element) for element in range(int(first), last)]
    return result


def load_contract(path: Path) -> ImportContract:
    """The contract in a YAML file.

    Raises:
        ConfigError: Unreadable, an unknown key, a wrong type, or parts that contradict.
    """
    return contract_of(read_yaml(path), where=str(path))


def contract_of(values: Any, *, where: str) -> ImportContract:
    """The contract that a parsed document describes.

    Raises:
        ConfigError: An unknown key, a wrong type, or parts that contradict.
    """
    if not isinstance(values, dict):
        _refuse(where, f"a {type(values).__name__}", "a mapping, as `genpolicy propose` writes it")
    contract = parse_settings(ImportContract, values, where=where)
    _check(contract, where)
    return contract


def dump_contract(contract: ImportContract) -> bytes:
    """The contract as YAML; equal contracts give equal bytes."""
    text = yaml.dump(
        contract.model_dump(mode="json"),
        Dumper=_Dumper,
        sort_keys=False,
        allow_unicode=True,
        width=100,
    )
    return (HEADER + text).encode()


def write_contract(path: Path, contract: ImportContract) -> None:
    """Write the contract, whole or not at all.

    Raises:
        BadInputError: The place cannot be written.
    """
    write_bytes(path, dump_contract(contract))


class _Dumper(yaml.SafeDumper):
    """PyYAML's safe dumper that writes lists of plain values on one line."""

    def represent_sequence(self, tag: str, sequence: Any, flow_style: Any = None) -> Any:
        plain = all(isinstance(v, str | int | float) and " " not in str(v) for v in sequence)
        return super().represent_sequence(tag, sequence, flow_style=plain or flow_style)

    def represent_mapping(self, tag: str, mapping: Any, flow_style: Any = None) -> Any:
        """One line for the form of a command: a robot has dozens of them."""
        line = set(mapping) == set(CommandForm.model_fields)
        return super().represent_mapping(tag, mapping, flow_style=line or flow_style)

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _check(contract: ImportContract, where: str) -> None:
    names: set[str] = set()
    for number, channel in enumerate(contract.channels):
        place = f"{where}: channels[{number}] ({channel.name})"
        if channel.name in {other.name for other in contract.channels[:number]}:
            _refuse(place, "a name that stands twice", "unique names")
        _check_width(channel.columns, channel.components, place, channel.transform == "cos_sin")
        if channel.transform == "cos_sin" and channel.unit not in ("rad", "deg"):
            _refuse(f"{place}.unit", repr(channel.unit), "rad or deg, for transform cos_sin")
        names |= {f"{channel.name}.{component}" for component in channel.components}
    _check_width(contract.action.columns, contract.action.components, f"{where}: action", False)
    if len(contract.action.units) != len(contract.action.components):
        found = f"{len(contract.action.units)} units for {len(contract.action.components)} numbers"
        _refuse(f"{where}: action.units", found, "one for each component")
    actions = {f"action.{component}" for component in contract.action.components}
    check_commands(
        contract.pairing,
        contract.forms,
        units=dict(zip(contract.action.components, contract.action_contract.units, strict=True)),
        observed={
            f"{c.name}.{component}": c.unit
            for c in contract.observation.channels
            for component in c.components
        },
        where=where,
    )
    for name, bounds in contract.ranges.items():
        if name not in names | actions:
            _refuse(f"{where}: ranges", f"for {name!r}", "names of the observation and the action")
        if len(bounds) != 2 or not bounds[0] < bounds[1]:
            _refuse(f"{where}: ranges.{name}", str(bounds), "a lower and an upper bound")
    streams = {channel.stream for channel in contract.channels} | {JOINTS_STREAM}
    for stream in contract.frozen.streams if contract.frozen else ():
        if stream not in streams:
            _refuse(f"{where}: frozen.streams", repr(stream), f"among {sorted(streams)}")
    limits = contract.joint_range_rad
    if limits is not None and (len(limits) != 2 or len(limits[0]) != len(limits[1])):
        _refuse(f"{where}: joint_range_rad", "not two rows of one length", "lower and upper")


def _check_width(columns: list[str], components: list[str], place: str, doubled: bool) -> None:
    width = len(selectors(columns, where=f"{place}.columns")) * (2 if doubled else 1)
    if width != len(components):
        _refuse(f"{place}.components", f"{len(components)} names", f"{width}, as its columns")
    if len(set(components)) != len(components):
        _refuse(f"{place}.components", "a name that stands twice", "unique names")


def _refuse(where: str, found: str, expected: str) -> NoReturn:
    raise ConfigError(
        where=where,
        found=found,
        expected=expected,
        action="Correct the contract, or let `genpolicy propose` write a new one.",
    )
