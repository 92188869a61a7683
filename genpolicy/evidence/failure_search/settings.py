"""How long failures are searched for: `card.failure_search`; the rest with its reasons."""

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from genpolicy.contract.settings import Settings, parse_settings
from genpolicy.errors import ConfigError

HOME, KEY = "card", "failure_search"
"""Section and key of `params.yaml`; the search stands between Gate D and the card."""
EVALUATIONS = 60
"""Six generations in nine dimensions: enough to go downhill, and of eight conditions two thirds of
what the comparison costs for one method."""
MOST_EVALUATIONS = 10_000
"""More rollouts of one condition than any ladder runs: beyond it a typing error."""
FIRST_SPREAD = 0.3
"""Standard deviation of the first generation, of coordinates in [0, 1]: most of it falls inside
from the middle, and the corners are reached."""
LEAST_SHARE = 0.01
"""Least size that is tried, as a share of the way from nothing to the largest that is stated: no
condition has a size of nothing, which would be another one."""


class SearchSettings(Settings):
    """Section `card.failure_search`.

    Attributes:
        evaluations: Rollouts of each candidate in each condition; 0: nobody looks, and the card
            says so. Fixed before anything is run: a search never goes on because it found nothing.
    """

    evaluations: int = Field(default=EVALUATIONS, ge=0, le=MOST_EVALUATIONS)


def search_settings(raw: Mapping[str, Any]) -> SearchSettings:
    """From the whole of `params.yaml`; of a section that is not there its defaults.

    Raises:
        ConfigError: No section but a value, an unknown key, no whole number, or out of its range.
    """
    section = raw.get(HOME)
    given = section.get(KEY, {}) if isinstance(section, dict) else {}
    where = f"params.yaml: {HOME}.{KEY}"
    if not isinstance(given, dict):
        raise ConfigError(
            where=where,
            found=repr(given)[:80],
            expected="a section, as {evaluations: 60}",
            action="Correct this setting.",
        )
    return parse_settings(SearchSettings, given, where=where)
