"""Settings: nothing unknown, nothing coerced, nothing changed; the place stands in the error."""

import pytest
from pydantic import ValidationError

from genpolicy.contract.settings import Settings, parse_settings
from genpolicy.errors import ConfigError


class Inner(Settings):
    share: float


class Section(Settings):
    count: int
    share: float = 0.5
    name: str = "x"
    inner: tuple[Inner, ...] = ()


def test_what_fits_is_taken_as_it_is():
    section = parse_settings(Section, {"count": 3, "inner": ({"share": 1.0},)}, where="s")
    assert section == Section(count=3, inner=(Inner(share=1.0),))
    assert Section.model_validate(section.model_dump()) == section


@pytest.mark.parametrize(
    ("values", "place"),
    [
        ({}, "s.count"),
        ({"count": 1, "cuont": 2}, "s.cuont"),
        ({"count": "1"}, "s.count"),
        ({"count": 1.0}, "s.count"),
        ({"count": True}, "s.count"),
        ({"count": 1, "share": True}, "s.share"),
        ({"count": 1, "share": float("nan")}, "s.share"),
        ({"count": 1, "share": float("inf")}, "s.share"),
        ({"count": 1, "name": 3}, "s.name"),
        ({"count": 1, "inner": ({"share": 1.0}, {"share": "a"})}, "s.inner.1.share"),
    ],
)
def test_what_does_not_fit_is_named_by_its_place(values, place):
    with pytest.raises(ConfigError, match=f"^{place} is .*Correct this setting") as caught:
        parse_settings(Section, values, where="s")
    assert caught.value.where == place
    assert caught.value.exit_code == 2


def test_a_long_value_is_cut():
    with pytest.raises(ConfigError) as caught:
        parse_settings(Section, {"count": "9" * 500}, where="s")
    assert len(caught.value.found) == 120


def test_settings_do_not_change():
    with pytest.raises(ValidationError, match="frozen"):
        Section(count=1).count = 2
