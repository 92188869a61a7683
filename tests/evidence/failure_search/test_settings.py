"""The one setting of the search, and what is refused of it."""

import pytest

from genpolicy.errors import ConfigError
from genpolicy.evidence.failure_search.settings import search_settings


def test_nobody_looks_where_nothing_is_said():
    assert search_settings({"card": {"name": "a"}}).failure_search == 0
    assert search_settings({}).failure_search == 0
    assert search_settings({"card": {"name": "a", "failure_search": 60}}).failure_search == 60


@pytest.mark.parametrize("value", [-1, 10_001, 2.5, "60", True, None])
def test_no_number_of_rollouts_is_refused(value):
    with pytest.raises(ConfigError, match=r"params\.yaml: card: failure_search"):
        search_settings({"card": {"failure_search": value}})
