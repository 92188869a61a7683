"""An ONNX file, run by ONNX Runtime on the CPU, in one order and with so many threads."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NoReturn

import numpy as np
import onnx
import onnxruntime
from numpy.typing import NDArray

from genpolicy.candidates.hosts.ports import Port
from genpolicy.errors import ContractError, IntegrityError

Array = NDArray[Any]
DOMAINS = ("", "ai.onnx", "ai.onnx.ml")
"""Whose operators ONNX Runtime brings itself."""
DRAWS = {
    "RandomNormal", "RandomNormalLike", "RandomUniform", "RandomUniformLike", "Multinomial",
    "Bernoulli",
}  # fmt: skip
ERRORS_ONLY = 3


class OnnxProgram:
    """A loaded file; see `ports.Program`.

    Args:
        data: Bytes of the file.
        where: Its path, for the error text.
        threads: Of an operator; operators run one after the other.
        external: Verified bytes of a file beside it, by the name that the tensors in it have.

    Attributes:
        inputs: By name.
        output: What it gives.

    Raises:
        IntegrityError: No ONNX file, one that this runtime cannot run, or one that draws.
        ContractError: Not one output.
    """

    def __init__(
        self, data: bytes, *, where: str, threads: int, external: Callable[[str], bytes]
    ) -> None:
        model = _parsed(data, where)
        for node in _nodes(model):
            if node.domain not in DOMAINS:
                _refuse(where, f"the operator {node.domain}::{node.op_type}")
            if node.op_type in DRAWS or (node.op_type == "Dropout" and len(node.input) > 2):
                _refuse(where, f"{node.op_type}, which draws by itself: make noise an input")
        _embed(model, where, external)
        self._model = model
        self._session = _session(model.SerializeToString(), where, threads)
        outputs = self._session.get_outputs()
        if len(outputs) != 1:
            raise ContractError(
                where=where,
                found=f"a program with {len(outputs)} outputs",
                expected="one array",
                action="Export a function that returns its chunk.",
            )
        self.inputs = {item.name: _port(item, where) for item in self._session.get_inputs()}
        self.output = _port(outputs[0], where)

    def run(self, arrays: Mapping[str, Array]) -> Array:
        """The output of arrays by name."""
        given = {name: port.given(arrays[name]) for name, port in self.inputs.items()}
        array: Array = self._session.run(None, given)[0]
        return array

    def uses(self, weight: str) -> int | None:
        """How many operators take a weight; None also where operators repeat, as in a loop."""
        graph = self._model.graph
        if self._model.functions or any(_subgraphs(node) for node in graph.node):
            return None
        if weight not in {item.name for item in graph.initializer}:
            return None
        return sum(weight in node.input for node in graph.node)


def _parsed(data: bytes, where: str) -> onnx.ModelProto:
    try:
        return onnx.load_model_from_string(data)
    except Exception as error:  # of protobuf, which has no public base for it
        _refuse(where, f"no ONNX file ({error})", cause=error)


def _nodes(model: onnx.ModelProto) -> Iterator[onnx.NodeProto]:
    """Every operator: of the graph, of functions, of what an operator repeats or chooses."""
    waiting = [*model.graph.node, *(node for own in model.functions for node in own.node)]
    own = {(function.domain, function.name) for function in model.functions}
    while waiting:
        node = waiting.pop()
        for graph in _subgraphs(node):
            waiting += graph.node
        if (node.domain, node.op_type) not in own:
            yield node


def _subgraphs(node: onnx.NodeProto) -> list[onnx.GraphProto]:
    return [
        graph
        for attribute in node.attribute
        for graph in ([attribute.g] if attribute.HasField("g") else [*attribute.graphs])
    ]


def _embed(model: onnx.ModelProto, where: str, external: Callable[[str], bytes]) -> None:
    """Take the tensors that lie in files beside it, so that the runtime opens none itself."""
    graphs = [model.graph, *(g for node in _nodes(model) for g in _subgraphs(node))]
    for tensor in (tensor for graph in graphs for tensor in graph.initializer):
        if tensor.data_location != onnx.TensorProto.EXTERNAL:
            continue
        said = {entry.key: entry.value for entry in tensor.external_data}
        data = external(said.get("location", ""))
        begin = int(said.get("offset", 0))
        length = int(said.get("length", len(data) - begin))
        if not 0 <= begin <= begin + length <= len(data):
            _refuse(where, f"the tensor {tensor.name}, which ends behind its file")
        tensor.raw_data = data[begin : begin + length]
        tensor.ClearField("external_data")
        tensor.data_location = onnx.TensorProto.DEFAULT
    if name := next(_elsewhere(model), None):
        _refuse(where, f"{name or 'a tensor'} in another file, which is no weight of its graphs")


def _elsewhere(message: Any) -> Iterator[str]:
    """Tensors anywhere in a model that the runtime would fetch from a file by itself."""
    for field, value in message.ListFields():
        if field.message_type is None:
            continue
        for item in value if isinstance(value, Sequence) else [value]:
            if isinstance(item, onnx.TensorProto):
                if item.data_location == onnx.TensorProto.EXTERNAL:
                    yield item.name or "a tensor"
            else:
                yield from _elsewhere(item)


def _session(data: bytes, where: str, threads: int) -> onnxruntime.InferenceSession:
    try:
        onnx.checker.check_model(data)
    except onnx.checker.ValidationError as error:
        _refuse(where, str(error).strip().splitlines()[0][:120], cause=error)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = threads
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.use_deterministic_compute = True
    options.log_severity_level = ERRORS_ONLY
    try:
        return onnxruntime.InferenceSession(
            data, sess_options=options, providers=["CPUExecutionProvider"]
        )
    # The runtime's exceptions have no common base but this.
    except Exception as error:
        _refuse(where, str(error).splitlines()[0][:120], cause=error)


def _port(item: Any, where: str) -> Port:
    kinds = {"tensor(float)": "float32", "tensor(double)": "float64"}
    if item.type not in kinds:
        raise ContractError(
            where=f"{item.name} of {where}",
            found=item.type,
            expected=f"one of {', '.join(kinds)}",
            action="Cast it inside the program.",
        )
    sizes = (size if isinstance(size, int) else None for size in item.shape)
    return Port(tuple(sizes), np.dtype(kinds[item.type]).name)


def _refuse(where: str, found: str, *, cause: Exception | None = None) -> NoReturn:
    raise IntegrityError(
        where=where,
        found=found,
        expected="an ONNX file of standard operators that ONNX Runtime runs on a CPU",
        action="Export it anew; onnx.checker and the runtime's own errors say more.",
    ) from cause
