"""A program of `torch.export`, loaded without a pickle and run on the CPU."""

import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.export import ExportedProgram
from torch.export.graph_signature import TensorArgument
from torch.utils._pytree import tree_unflatten

from genpolicy.candidates.hosts.ports import Port
from genpolicy.candidates.hosts.torch_archive import without_code
from genpolicy.errors import BadInputError, ContractError, IntegrityError
from genpolicy.policies.determinism import deterministic

Array = NDArray[Any]


class TorchProgram:
    """A loaded program; see `ports.Program`.

    Args:
        data: Bytes of the `.pt2` archive.
        where: Its path, for the error text.
        threads: Of an operator; operators run one after the other.

    Attributes:
        inputs: By name.
        output: What it gives.

    Raises:
        IntegrityError: No archive, or one that could run code.
        ContractError: Inputs that are no arrays, not one output, or draws of its own.
    """

    def __init__(self, data: bytes, *, where: str, threads: int) -> None:
        self._threads = threads
        self._program = _loaded(without_code(data, where=where), where)
        _require_no_draws(self._program, where)
        signature, values = self._program.graph_signature, {}
        for node in self._program.graph.nodes:
            values[node.name] = node.meta.get("val")
        outputs = signature.output_specs
        if len(outputs) != 1 or not isinstance(outputs[0].arg, TensorArgument):
            raise ContractError(
                where=where,
                found=f"a program with {len(outputs)} outputs",
                expected="one array",
                action="Export a function that returns its chunk, and changes nothing.",
            )
        self.inputs = {
            spec.arg.name: _port(values[spec.arg.name], where)
            for spec in signature.input_specs
            if spec.kind.name == "USER_INPUT"
        }
        self.output = _port(values[outputs[0].arg.name], where)
        self._module = self._program.module()

    def run(self, arrays: Mapping[str, Array]) -> Array:
        """The output of arrays by name."""
        flat = [torch.from_numpy(port.given(arrays[name])) for name, port in self.inputs.items()]
        in_spec = self._program.call_spec.in_spec
        assert in_spec is not None  # an exported program has one
        positional, named = tree_unflatten(flat, in_spec)
        with deterministic("cpu"), _threads(self._threads), torch.inference_mode():
            found = self._module(*positional, **named)
        array: Array = (found if isinstance(found, torch.Tensor) else found[0]).numpy()
        return array

    def uses(self, weight: str) -> int | None:
        """How many operators take a weight: each runs once."""
        signature = self._program.graph_signature
        names = {**signature.inputs_to_parameters, **signature.inputs_to_buffers}
        for node in self._program.graph.nodes:
            if names.get(node.name) == weight:
                return len(node.users)
        return None


@contextmanager
def _threads(number: int) -> Iterator[None]:
    """So many threads instead of the one of `deterministic`."""
    if number == 1:
        yield
        return
    torch.set_num_threads(number)
    try:
        yield
    finally:
        torch.set_num_threads(1)


def _loaded(data: bytes, where: str) -> ExportedProgram:
    try:
        return torch.export.load(io.BytesIO(data))
    except BadInputError:
        raise
    except Exception as error:  # whatever torch says of a graph that is none
        raise IntegrityError(
            where=where,
            found=f"no program that torch {torch.__version__} can read ({str(error)[:120]})",
            expected="what `torch.export.save` of this version writes",
            action="Export it with this version of torch.",
        ) from error


def _require_no_draws(program: ExportedProgram, where: str) -> None:
    for node in program.graph.nodes:
        tags = getattr(node.target, "tags", ())
        if torch.Tag.nondeterministic_seeded in tags:
            raise ContractError(
                where=where,
                found=f"a program that draws by itself ({node.target})",
                expected="noise as an input, so that a draw can be named and drawn again",
                action="Make the noise an argument of the exported function.",
            )


def _port(value: Any, where: str) -> Port:
    if not isinstance(value, torch.Tensor):
        raise ContractError(
            where=where,
            found=f"a program with {type(value).__name__} among its inputs",
            expected="arrays only",
            action="Fix everything else when it is exported.",
        )
    dtype = np.dtype(str(value.dtype).removeprefix("torch.")).name
    return Port(tuple(int(size) for size in value.shape), dtype)
