"""A checkpoint as a program of `torch.export`: the same bytes for the same checkpoint."""

import io

import torch

from genpolicy.candidates.exports.unrolled import Exported
from genpolicy.candidates.hosts.torch_archive import without_code


def torch_bytes(exported: Exported) -> bytes:
    """The `.pt2` archive of a program, without sample inputs, which would be a pickle."""
    with torch.no_grad():
        program = torch.export.export(
            exported.module, tuple(exported.inputs.values()), strict=False
        )
    stream = io.BytesIO()
    torch.export.save(program, stream)
    return without_code(stream.getvalue(), where="the export")
