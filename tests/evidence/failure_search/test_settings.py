"""The one setting of the search, and what is refused of it."""

import pytest

from genpolicy.errors import ConfigError
from genpolicy.evidence.failure_search.settings import EVALUATIONS, search_settings


def test_sixty_rollouts_where_nothing_is_said_and_none_where_nobody_looks():
    for said in ({}, {"card": {"name": "a"}}, {"card": {"failure_search": {}}}):
        assert search_settings(said).evaluations == EVALUATIONS == 60
    assert search_settings({"card": {"failure_search": {"evaluations": 0}}}).evaluations == 0


@pytest.mark.parametrize("value", [-1, 10_001, 2.5, "60", True, None])
def test_no_number_of_rollouts_is_refused(value):
    with pytest.raises(ConfigError, match=r"params\.yaml: card\.failure_search\.evaluations"):
        search_settings({"card": {"failure_search": {"evaluations": value}}})


@pytest.mark.parametrize("section", [60, None, [], {"evaluation": 60}])
def test_what_is_no_section_or_has_another_key_is_refused(section):
    with pytest.raises(ConfigError, match=r"params\.yaml: card\.failure_search"):
        search_settings({"card": {"failure_search": section}})
