"""Whether the libraries of the extra `onnx` are there."""

from importlib.util import find_spec

from genpolicy.errors import ConfigError


def require_onnx(*names: str) -> None:
    """Refuse to go on without these libraries.

    Raises:
        ConfigError: One of them is not installed.
    """
    for name in names:
        if find_spec(name) is None:
            raise ConfigError(
                where="ONNX",
                found=f"without the library {name}",
                expected="the libraries of the extra onnx",
                action="Install them: pip install 'genpolicy[onnx]'.",
            )
