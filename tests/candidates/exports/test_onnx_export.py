import onnx
import pytest

from genpolicy.candidates.exports.onnx_export import onnx_bytes
from genpolicy.candidates.exports.unrolled import whole
from genpolicy.candidates.hosts import onnx_library
from genpolicy.errors import ConfigError


def test_equal_checkpoints_are_equal_bytes_in_one_file_without_places(policy, capsys):
    data = onnx_bytes(whole(policy))
    assert capsys.readouterr().out == ""
    assert onnx_bytes(whole(policy)) == data
    assert b".py" not in data
    model = onnx.load_model_from_string(data)
    assert not any(item.external_data for item in model.graph.initializer)
    assert [item.name for item in model.graph.input] == ["observation", "noise"]


def test_without_the_library_it_is_one_sentence(policy, monkeypatch):
    monkeypatch.setattr(onnx_library, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"pip install 'genpolicy\[onnx\]'"):
        onnx_bytes(whole(policy))
