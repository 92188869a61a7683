"""The host of an entry: its files verified, its program loaded and held against the entry."""

from collections.abc import Mapping
from pathlib import Path

from genpolicy.candidates.hosts.hosted import Given, HostedPolicy, Served
from genpolicy.candidates.hosts.kinds import (
    KINDS,
    HostedEntry,
    OnnxEntry,
    ProgramEntry,
    ScriptedEntry,
    TorchEntry,
    TrainedEntry,
    chosen,
    read_entry,
)
from genpolicy.candidates.hosts.onnx_library import require_onnx
from genpolicy.candidates.hosts.own_checkpoint import require_as_declared
from genpolicy.candidates.hosts.ports import Program, check_ports
from genpolicy.candidates.hosts.scripted import scripted_function
from genpolicy.candidates.judged import loaded_on, sampling_by
from genpolicy.candidates.wire.declared import Choice
from genpolicy.candidates.wire.entry import Entry, read_file, verify_files
from genpolicy.candidates.wire.served import OBSERVATION, ServedPolicy
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.policies.policy import NetworkPolicy

HOSTED = [name for name, kind in KINDS.items() if issubclass(kind, HostedEntry)]


def hosted(
    path: Path, *, sha256: str | None, widths: Mapping[str, int], threads: int | None = None,
    observation: str | None = None,
) -> Served:  # fmt: skip
    """Who answers for an entry.

    Args:
        path: The entry.
        sha256: What the entry must say; None for whatever it says.
        widths: Numbers of each input, where they are known.
        threads: Of a program's operators, in place of those of the entry; None: those.
        observation: SHA-256 of the observation contract in force, where it is known.

    Raises:
        ConfigError: The entry is wrong, of a kind that is hosted elsewhere, lacks a library, or
            says of a checkpoint what the checkpoint does not say of itself.
        IntegrityError: The entry, or a file of it, is another one, or could run code.
        ContractError: The program takes or gives something else than the entry says.
    """
    entry, folder = read_entry(path), path.resolve().parent
    if sha256 is not None and entry.sha256 != sha256:
        raise IntegrityError(
            where=str(path),
            found=f"an entry with sha256 {entry.sha256[:16]}…",
            expected=f"{sha256[:16]}…, as when it was asked for",
            action="Start again; an entry does not change while its candidate is judged.",
        )
    verify_files(entry, folder)
    if isinstance(entry, TrainedEntry):
        policy = loaded_on(entry.device, folder / entry.checkpoint)
        require_as_declared(entry, policy, width=widths.get(OBSERVATION), observation=observation)
        return ServedPolicy(policy, samplers=_chosen(policy, entry.samplers))
    if isinstance(entry, ProgramEntry):
        return _program(entry, folder, widths, threads or entry.threads)
    if isinstance(entry, ScriptedEntry):
        call = scripted_function(
            _bytes(entry, folder, entry.file), path=str(folder / entry.file),
            name=entry.function.partition(":")[2],
        )  # fmt: skip
        return HostedPolicy(entry, call, widths=widths)
    raise ConfigError(
        where=f"{path}.kind",
        found=f"{entry.kind}, which has a server of its own",
        expected=f"a kind that is hosted here ({', '.join(HOSTED)})",
        action="Check it with `genpolicy check-candidate`, which starts that server.",
    )


def _chosen(policy: NetworkPolicy, choices: Mapping[str, Choice]) -> dict[str, NetworkPolicy]:
    """A checkpoint under each setting that its entry lets be asked for.

    Raises:
        ConfigError: No sampler of ours, or none of its method.
    """
    found = {}
    for name, choice in choices.items():
        sampler = chosen(policy.sampler, choice, where=f"samplers.{name}")
        found[name] = sampling_by(policy, sampler)
    return found


def _program(
    entry: ProgramEntry, folder: Path, widths: Mapping[str, int], threads: int
) -> HostedPolicy:
    program = _loaded(entry, folder, entry.program, threads)
    encoder = _loaded(entry, folder, entry.encoder.program, threads) if entry.encoder else None
    check_ports(entry, program, encoder, widths)
    evaluations = None
    if entry.counted_weight is not None:
        evaluations = program.uses(entry.counted_weight)
        if not evaluations:
            raise ConfigError(
                where=f"counted_weight of the candidate {entry.name}",
                found=f"{entry.counted_weight!r}, which cannot be counted in {entry.program}",
                expected="a weight of a program whose operators run once each",
                action="Name one, or leave it out: its evaluations are then unknown.",
            )
    if encoder is None or entry.encoder is None:
        return HostedPolicy(entry, program.run, evaluations=evaluations, widths=widths)
    gives = entry.encoder.gives

    def encode(given: Given) -> Given:
        return {gives: encoder.run(given)}

    return HostedPolicy(entry, program.run, encode=encode, evaluations=evaluations, widths=widths)


def _loaded(entry: ProgramEntry, folder: Path, name: str, threads: int) -> Program:
    data, where = _bytes(entry, folder, name), str(folder / name)
    if isinstance(entry, TorchEntry):
        from genpolicy.candidates.hosts.torch_program import TorchProgram  # noqa: PLC0415

        return TorchProgram(data, where=where, threads=threads)
    assert isinstance(entry, OnnxEntry)  # there is no third kind of program
    require_onnx("onnx", "onnxruntime")
    from genpolicy.candidates.hosts.onnx_program import OnnxProgram  # noqa: PLC0415

    def external(location: str) -> bytes:
        return _bytes(entry, folder, (Path(name).parent / location).as_posix())

    return OnnxProgram(data, where=where, threads=threads, external=external)


def _bytes(entry: Entry, folder: Path, name: str) -> bytes:
    """A file that the entry pins.

    Raises:
        ConfigError: It pins no such file.
        IntegrityError: It is another one.
    """
    if name not in entry.files:
        raise ConfigError(
            where=f"files of the candidate {entry.name}",
            found=f"without {name}, which it reads",
            expected="the SHA-256 of every file that it reads",
            action=f"Write `{name}: <sha256>` into `files`.",
        )
    return read_file(entry, folder, name, entry.files[name])
