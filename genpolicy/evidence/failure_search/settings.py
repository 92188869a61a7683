"""How long failures are searched for: `card.failure_search`; the rest with its reasons."""

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from genpolicy.contract.settings import Settings, parse_settings

HOME, KEY = "card", "failure_search"
"""Section and key of `params.yaml`; the search stands between Gate D and the card."""
MOST_EVALUATIONS = 10_000
"""More rollouts of one condition than any ladder runs: beyond it a typing error."""
FIRST_SPREAD = 0.3
"""Standard deviation of the first generation, of coordinates in [0, 1]: most of it falls inside
from the middle, and the corners are reached."""
LEAST_SHARE = 0.01
"""Least size that is tried, as a share of the way from nothing to the largest that is stated: no
condition has a size of nothing, which would be another one."""


class SearchSettings(Settings):
    """What of the section `card` the search reads.

    Attributes:
        failure_search: Rollouts of each candidate in each condition; 0: nobody looks, and the card
            says so. Fixed before anything is run: a search never goes on because it found nothing.
    """

    failure_search: int = Field(default=0, ge=0, le=MOST_EVALUATIONS)


def search_settings(raw: Mapping[str, Any]) -> SearchSettings:
    """From the whole of `params.yaml`.

    Raises:
        ConfigError: No whole number, or out of its range.
    """
    section = raw.get(HOME)
    given = section if isinstance(section, dict) else {}
    wanted = {KEY: given[KEY]} if KEY in given else {}
    return parse_settings(SearchSettings, wanted, where=f"params.yaml: {HOME}")
