"""Settings: nothing unknown, nothing coerced, nothing changed; the place stands in the error."""

import pytest
from pydantic import ValidationError

from genpolicy.audit.settings import AuditSettings
from genpolicy.contract.settings import RENAMED, Settings, parse_settings
from genpolicy.errors import ConfigError
from genpolicy.evidence.shadow.settings import ShadowSection
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.policies.settings import TrainingConfig
from stages._training import FactorsSection


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


class Training(Settings):
    updates: int


class Policy(Settings):
    training: Training


@pytest.mark.parametrize(
    ("model", "where", "values", "place"),
    [
        (Policy, "params.yaml: policy", {"training": {"steps": 3}}, "policy.training.steps"),
        (Policy, "params.yaml: policy", {"training": {"updates": 1, "warmup_steps": 3}},
         "policy.training.warmup_steps"),
        (Training, "params.yaml: train_factors", {"steps": 3}, "train_factors.steps"),
    ],
)  # fmt: skip
def test_a_key_that_has_another_name_now_is_told_it(model, where, values, place):
    old, now = place.rpartition(".")[2], RENAMED[place]
    said = rf"^params\.yaml: {place} is an unknown key {old}; it is called {now} now, expected"
    with pytest.raises(ConfigError, match=said):
        parse_settings(model, values, where=where)


def test_the_same_word_elsewhere_is_an_unknown_key_and_no_old_name():
    with pytest.raises(ConfigError, match="Extra inputs are not permitted"):
        parse_settings(Section, {"count": 1, "steps": 3}, where="params.yaml: reload")


def test_every_name_that_an_old_key_has_now_is_one_of_its_section():
    fields = {
        "policy.training": TrainingConfig,
        "train_factors": FactorsSection,
        "execution": ExecutionSettings,
        "shadow": ShadowSection,
        "audit": AuditSettings,
    }
    for place, now in RENAMED.items():
        section, _, old = place.rpartition(".")
        assert now in fields[section].model_fields
        assert old not in fields[section].model_fields


def test_a_long_value_is_cut():
    with pytest.raises(ConfigError) as caught:
        parse_settings(Section, {"count": "9" * 500}, where="s")
    assert len(caught.value.found) == 120


def test_settings_do_not_change():
    with pytest.raises(ValidationError, match="frozen"):
        Section(count=1).count = 2
