"""Kernels are compiled for one signature, and kept under a name of all their code."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from genpolicy import compiled as module
from genpolicy.feasibility import kernels
from genpolicy.feasibility.kernels.arm import place_all

KERNELS = Path(kernels.__file__).parent


def test_the_folder_of_the_cache_is_named_after_all_the_code(tmp_path):
    (tmp_path / "a.py").write_text("one")
    (tmp_path / "b.py").write_text("two")
    first = module.cache_folder(tmp_path)
    assert first.parent == tmp_path / "__pycache__"
    assert module.cache_folder(tmp_path) == first
    (tmp_path / "b.py").write_text("three")  # a callee, in another file than its caller
    assert module.cache_folder(tmp_path) != first


def test_how_it_is_compiled_names_the_folder_too(tmp_path, monkeypatch):
    """Else a kernel that was compiled with other rounding would be found under the same name."""
    kernels, edited = tmp_path / "kernels", tmp_path / "compiled.py"
    kernels.mkdir()
    first = module.cache_folder(kernels)
    edited.write_text(Path(module.__file__).read_text() + "# edited")
    monkeypatch.setattr(module, "__file__", str(edited))
    assert module.cache_folder(kernels) != first


def test_what_is_compiled_lies_in_that_folder():
    assert list(module.cache_folder(KERNELS).rglob("*.nbi"))


def test_a_copy_of_the_code_compiles_nothing_again(tmp_path):
    """Wrong before: numba named it by the path of the code, so that each workspace compiled."""
    package = Path(module.__file__).parent
    shutil.copytree(package, tmp_path / package.name)
    code = (
        "from genpolicy.feasibility.kernels import turn\n"
        "print(turn.__file__, sum(turn.angle.stats.cache_misses.values()))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path)}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    path, misses = done.stdout.split()
    assert Path(path).is_relative_to(tmp_path)
    assert misses == "0"


def test_the_users_own_place_goes_first(tmp_path, monkeypatch):
    monkeypatch.setattr(module.numba.config, "CACHE_DIR", str(tmp_path))

    @module.compiled("f8(f8)")
    def twice(value):
        return 2.0 * value

    assert twice(2.0) == 4.0
    assert list(tmp_path.rglob("*twice*.nbi"))
    assert not list(module.cache_folder(Path(__file__).parent).rglob("*twice*"))
    assert not module.numba.config.CACHE_LOCATOR_CLASSES


@pytest.mark.parametrize(("fused", "expected"), [(False, 0.0), (True, 2.0**-54)])
def test_a_product_is_rounded_with_the_sum_only_where_that_is_asked_for(
    tmp_path, monkeypatch, fused, expected
):
    """0.1 * 10 - 1: nothing is left of a rounded product; of the exact one its rounding is."""
    monkeypatch.setattr(module.numba.config, "CACHE_DIR", str(tmp_path))

    @module.compiled("f8(f8, f8, f8)", fused=fused)
    def joined(one, other, third):
        return one * other + third

    assert joined(0.1, 10.0, -1.0) == expected


def test_another_kind_of_array_is_refused_and_not_compiled():
    q = np.zeros((2, 7), dtype=np.float32)
    room = np.empty((2, 8, 3, 3)), np.empty((2, 8, 3))
    with pytest.raises(TypeError, match="No matching definition"):
        place_all(np.zeros((8, 3, 3)), np.zeros((8, 3)), q, *room)
    assert module.owned(q).dtype == np.float64


def test_owned_copies_only_what_a_kernel_could_not_take():
    values = np.arange(6.0).reshape(2, 3)
    assert module.owned(values) is values
    frozen = values.copy()
    frozen.flags.writeable = False
    for other in (frozen, values.T):
        taken = module.owned(other)
        assert taken.flags.writeable and taken.flags.c_contiguous
        assert np.array_equal(taken, other)
