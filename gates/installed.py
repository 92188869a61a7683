"""What is installed here, asked each time: part of what a report is derived from."""

import contextlib
import importlib.metadata
import platform
import re

LIBRARIES = (
    "numpy", "pandas", "pyarrow", "pydantic", "scipy",
    "scikit-learn", "torch", "mujoco", "pin", "numba",
)  # fmt: skip
"""What judges, and what the evidence comes from: the audit, the networks, the arm, its motion."""
VERSION = re.compile(r"^Version: *(\S+) *$", re.MULTILINE)
REGIME = (
    "bit-equal for the same wheels, CPU capability, one thread and one batch shape; "
    "elsewhere samples within 1e-5 and the same verdict"
)


def environment() -> dict[str, str]:
    """Versions of installed libraries and the regime of the numbers: part of what is derived."""
    found = {}
    for name in LIBRARIES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[name] = _version(name)
    found["python"] = ".".join(platform.python_version_tuple()[:2])
    found["regime"] = REGIME
    return found


def _version(library: str) -> str:
    """As `importlib.metadata.version`, without parsing the licences behind the header.

    Raises:
        importlib.metadata.PackageNotFoundError: It is not installed.
    """
    installed = importlib.metadata.distribution(library)
    head, _, _ = (installed.read_text("METADATA") or "").partition("\n\n")
    said = VERSION.search(head)
    return said[1] if said else installed.version
