"""What a program takes and gives, held against what its entry says, before it is asked anything."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NoReturn, Protocol

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.hosts.kinds import DrawingEntry, ProgramEntry
from genpolicy.errors import ContractError

Array = NDArray[Any]
NOISE = "float32"


@dataclass(frozen=True)
class Port:
    """One array of a program.

    Attributes:
        shape: Its sizes; None where the program takes any.
        dtype: Type of its numbers, by NumPy's name.
    """

    shape: tuple[int | None, ...]
    dtype: str

    def takes(self, wanted: "Port") -> bool:
        """Whether an array of `wanted` fits; a batch axis of one in front is no difference."""
        own = self.shape
        if len(own) == len(wanted.shape) + 1 and own[0] in (1, None):
            own = own[1:]
        if len(own) != len(wanted.shape) or self.dtype != wanted.dtype:
            return False
        return all(a is None or b is None or a == b for a, b in zip(own, wanted.shape, strict=True))

    def __str__(self) -> str:
        sizes = ", ".join("any" if size is None else str(size) for size in self.shape)
        return f"{self.dtype} ({sizes})"

    def given(self, array: Array) -> Array:
        """An array with the batch axis that the program wants."""
        return array[None] if len(self.shape) > array.ndim else array


class Program(Protocol):
    """A loaded program.

    Attributes:
        inputs: By name.
        output: What it gives.
    """

    inputs: dict[str, Port]
    output: Port

    def run(self, arrays: Mapping[str, Array]) -> Array:
        """The output of arrays by name, each of its port's shape."""
        ...

    def uses(self, weight: str) -> int | None:
        """How often one run uses a weight; None where it has no such, or steps that repeat."""
        ...


def wanted_inputs(entry: DrawingEntry, widths: Mapping[str, int]) -> dict[str, Port]:
    """What the entry gives of the observation, by name."""
    return {
        name: Port((*([part.history] if part.history > 1 else []), widths.get(name)), part.dtype)
        for name, part in entry.observation.items()
    }


def check_ports(
    entry: ProgramEntry, program: Program, encoder: Program | None, widths: Mapping[str, int]
) -> None:
    """Hold what a program takes and gives against its entry.

    Args:
        entry: What is declared.
        program: The program, or what is left of it behind the encoder.
        encoder: What looks at the observation, where it is apart.
        widths: Numbers of each input, where they are known.

    Raises:
        ContractError: A name, shape or type that differs, both sides named.
    """
    seen = wanted_inputs(entry, widths)
    noise = {}
    if entry.noise is not None:
        noise[entry.noise.input] = Port(entry.noise.whole_shape, NOISE)
    if encoder is None or entry.encoder is None:
        _same(entry.program, program.inputs, {**seen, **noise})
    else:
        _same(entry.encoder.program, encoder.inputs, seen)
        _same(entry.program, program.inputs, {entry.encoder.gives: encoder.output, **noise})
    _check_output(entry, program)


def chunk_of(array: Array, entry: DrawingEntry, *, said_by: str) -> Array:
    """The chunk (K, D) of an answer, without its batch axis.

    Args:
        array: The answer.
        entry: What is declared.
        said_by: Who gave it, for the error text.

    Raises:
        ContractError: It is none.
    """
    chunk = array[0] if array.ndim == 3 and len(array) == 1 else array
    rows, width = entry.horizons.prediction_horizon, entry.action.width
    if chunk.ndim != 2 or len(chunk) != rows or chunk.shape[1] < width:
        shape = tuple(int(size) for size in array.shape)
        _refuse(f"the answer of {said_by}", f"of shape {shape}", _expected_chunk(entry))
    return chunk


def _check_output(entry: ProgramEntry, program: Program) -> None:
    sizes = program.output.shape
    if len(sizes) == 3 and sizes[0] in (1, None):
        sizes = sizes[1:]
    rows, width = entry.horizons.prediction_horizon, entry.action.width
    fits = (
        len(sizes) == 2
        and sizes[0] in (rows, None)
        and (sizes[1] is None or sizes[1] >= width)
        and np.dtype(program.output.dtype).kind == "f"
    )
    if not fits:
        _refuse(f"output of {entry.program}", str(program.output), _expected_chunk(entry))


def _expected_chunk(entry: DrawingEntry) -> str:
    return (
        f"({entry.horizons.prediction_horizon}, at least {entry.action.width}) floating-point "
        "numbers, as its entry says"
    )


def _same(file: str, own: Mapping[str, Port], wanted: Mapping[str, Port]) -> None:
    if set(own) != set(wanted):
        _refuse(
            f"inputs of {file}", ", ".join(own) or "none", f"{', '.join(wanted)}, as its entry says"
        )
    for name, port in wanted.items():
        if not own[name].takes(port):
            _refuse(f"input {name} of {file}", str(own[name]), f"{port}, as its entry says")


def _refuse(where: str, found: str, expected: str) -> NoReturn:
    raise ContractError(
        where=where,
        found=found,
        expected=expected,
        action="Correct the entry, or export the program anew.",
    )
