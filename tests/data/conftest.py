"""The factory of synthetic episodes as a fixture (tests are not a package)."""

import importlib.util
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def factory():
    path = Path(__file__).parent / "factory.py"
    spec = importlib.util.spec_from_file_location("dataset_factory", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def built(factory, tmp_path_factory):
    return factory.build(tmp_path_factory.mktemp("good"))
