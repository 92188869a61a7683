"""One search of two conditions by a barely trained flow, shared by the tests."""

import pytest
from _searched import make_bench, write_searched


@pytest.fixture(scope="session")
def bench(fleet, dataset, kit, tmp_path_factory):
    return make_bench(fleet, dataset, kit, tmp_path_factory.mktemp("artifacts"))


@pytest.fixture(scope="session")
def written(bench, kit, tmp_path_factory):
    """Folder of the stage, and the searches."""
    folder = tmp_path_factory.mktemp("searched") / "failure_search"
    return folder, write_searched(folder, bench, kit)
