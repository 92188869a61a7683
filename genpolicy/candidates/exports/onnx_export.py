"""A checkpoint as an ONNX file: one file, the same bytes for the same checkpoint."""

import contextlib
import io
import logging
import warnings

import torch

from genpolicy.candidates.exports.unrolled import Exported
from genpolicy.candidates.hosts.onnx_library import require_onnx

OPSET = 20


def onnx_bytes(exported: Exported) -> bytes:
    """The ONNX file of a program.

    Raises:
        ConfigError: The libraries of the extra `onnx` are not installed.
    """
    require_onnx("onnx", "onnxscript")
    for chatty in ("torch.onnx", "onnxscript", "onnx_ir"):
        logging.getLogger(chatty).setLevel(logging.ERROR)
    # The exporter reports its progress on stdout.
    with torch.no_grad(), contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        program = torch.onnx.export(
            exported.module, tuple(exported.inputs.values()), dynamo=True, opset_version=OPSET,
            input_names=list(exported.inputs), output_names=[exported.output], verbose=False,
        )  # fmt: skip
    assert program is not None  # with `dynamo` a program comes back
    proto = program.model_proto
    # Where its source stood, line by line, is of no use to a reader, and differs by machine.
    for part in (proto, proto.graph, *proto.graph.node, *proto.graph.value_info,
                 *proto.graph.input, *proto.graph.output, *proto.graph.initializer):  # fmt: skip
        part.ClearField("metadata_props")
        part.ClearField("doc_string")
    data: bytes = proto.SerializeToString(deterministic=True)
    return data
