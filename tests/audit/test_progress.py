"""How far the audit is: told in full, and of no influence."""

import pytest
from planar import SETTINGS, admissible, planar
from planar_dataset import dataset_of

from genpolicy.audit import audit

NAMES = {"ignored_channels": [], "context_channels": ["goal", "lamp"], "reference_channel": "goal"}


@pytest.fixture(scope="module")
def valid():
    return planar(episodes=120)


def test_progress_is_told_and_changes_nothing(valid):
    data, replayed = valid
    settings = SETTINGS.model_copy(update={**NAMES, "query_stride": 20})
    told = []
    options = {"admissible": admissible, "replay": replayed.__getitem__, "root_seed": 3}
    with_it = audit(dataset_of(data), settings, progress=lambda *a: told.append(a), **options)
    assert with_it.as_json() == audit(dataset_of(data), settings, **options).as_json()
    last = {what: (done, total) for what, done, total in told}
    assert {"situations examined", "episodes replayed"} <= set(last)
    assert all(done == total for done, total in last.values())
