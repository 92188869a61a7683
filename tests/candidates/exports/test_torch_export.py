import zipfile
from io import BytesIO

from genpolicy.candidates.exports.torch_export import torch_bytes
from genpolicy.candidates.exports.unrolled import whole


def test_equal_checkpoints_are_equal_bytes_without_a_pickle_and_without_places(policy):
    data = torch_bytes(whole(policy))
    assert torch_bytes(whole(policy)) == data
    with zipfile.ZipFile(BytesIO(data)) as archive:
        assert archive.read("program/data/sample_inputs/model.pt") == b""
    assert b".py" not in data
