"""Everything that a plan of short rollouts needs."""

import pytest
from _probed import make_bench


@pytest.fixture(scope="session")
def bench(fleet, dataset, kit, tmp_path_factory):
    return make_bench(fleet, dataset, kit, tmp_path_factory.mktemp("artifacts"))
