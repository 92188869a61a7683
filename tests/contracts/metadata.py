"""The metadata that an installation makes of `pyproject.toml`, for the tests of entry points.

An editable installation keeps those of the day when it was made; these are of the tree.
"""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]


def project() -> dict:
    """The table `project` of pyproject.toml."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def write_metadata(folder: Path) -> Path:
    """Write a `.dist-info` of this project into `folder`, which goes first on the path."""
    own = project()
    info = folder / f"{own['name']}-{own['version']}.dist-info"
    info.mkdir(parents=True)
    requires = [f"Requires-Dist: {requirement}" for requirement in own["dependencies"]]
    head = ["Metadata-Version: 2.1", f"Name: {own['name']}", f"Version: {own['version']}"]
    (info / "METADATA").write_text("\n".join([*head, *requires, ""]))
    lines = []
    for group, points in own["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in points.items()), ""]
    (info / "entry_points.txt").write_text("\n".join(lines))
    return folder


def name_of(requirement: str) -> str:
    """The distribution that a requirement names, in one spelling."""
    return re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", requirement)[0]).lower()
