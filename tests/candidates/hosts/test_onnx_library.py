import pytest

from genpolicy.candidates.hosts.onnx_library import require_onnx
from genpolicy.errors import ConfigError


def test_what_is_missing_is_named_with_what_brings_it():
    require_onnx("onnx", "onnxruntime")
    with pytest.raises(ConfigError, match=r"without the library onnx_nowhere.*genpolicy\[onnx\]"):
        require_onnx("onnx", "onnx_nowhere")
