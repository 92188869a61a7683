"""Pages by the Nu HTML checker, where Java is and the variable VNU names its `vnu.jar`.

The jar is in the npm package `vnu-jar`. Nothing but the tests that ask it needs either; where one
is missing, the rules of `markup.py` alone are asked of the pages.
"""

import os
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest

VNU = os.environ.get("VNU", "")
asked = pytest.mark.skipif(
    not VNU or shutil.which("java") is None,
    reason="no Java, or VNU names no vnu.jar (of the npm package vnu-jar): the Nu checker was not "
    "asked of the pages",
)
NO_DATA_IMAGES = ".*image .data:image/.* blocked by .img-src. directive.*"
"""It takes no picture inside a page to be allowed, not even by a policy of `img-src data:` alone;
browsers do (`test_a_picture_inside_a_page_is_shown_under_its_own_policy`)."""


def complaints(pages: Mapping[str, str], folder: Path) -> str:
    """What the checker says of pages, errors and warnings; empty of what is valid.

    Args:
        pages: By name.
        folder: For the files that it is given.
    """
    for name, text in pages.items():
        (folder / f"{name}.html").write_text(text)
    files = sorted(str(path) for path in folder.glob("*.html"))
    command = ["java", "-jar", VNU, "--format", "gnu", "--filterpattern", NO_DATA_IMAGES, *files]
    done = subprocess.run(command, capture_output=True, check=False)
    return done.stderr.decode()
