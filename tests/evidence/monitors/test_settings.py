"""Section `monitors`: conditions by name, and what is refused."""

from pathlib import Path

import pytest
import yaml
from pydantic import ValidationError

from genpolicy.evidence.monitors.settings import MonitorsSettings, condition_of, family_of

GOOD = {
    "kinds": ["support"], "threshold_starts": 1, "judged_starts": 1, "probe_starts": 1,
    "probes": {"lighting": {"severities": [0.5, 2.0]}},
}  # fmt: skip


def test_conditions_are_named_by_family_and_severity():
    settings = MonitorsSettings(**GOOD)
    assert settings.conditions == ("lighting@0.5", "lighting@2")
    assert [family_of(name) for name in settings.conditions] == [
        ("lighting", 0.5), ("lighting", 2.0),
    ]  # fmt: skip
    assert family_of("judged") == ("nominal", 0.0)
    assert family_of(condition_of("contact_anomaly", 0.25)) == ("contact_anomaly", 0.25)
    assert settings.watching == ("support", "time_in_episode", "sample_variance")


def test_the_rollouts_of_the_default_are_as_many_as_is_said():
    root = Path(__file__).parents[3]
    text = (root / "params.yaml").read_text()
    found = MonitorsSettings(**yaml.safe_load(text)["monitors"])
    probed = found.probe_starts * len(found.conditions)
    count = found.threshold_starts + found.judged_starts + probed
    assert f"probes; {count} rollouts of each" in text
    assert f"The default is {count} rollouts" in (root / "docs/monitors.md").read_text()


def test_nothing_asked_is_off():
    assert not MonitorsSettings().on
    assert not MonitorsSettings(**GOOD | {"kinds": []}).on
    assert MonitorsSettings(**GOOD).on


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"kinds": ["intuition"]}, "no monitor"),
        ({"kinds": ["time_in_episode"]}, "no monitor"),
        ({"judged_starts": 0}, "of their own"),
        ({"probes": {"lighting": {"severities": [2.0, 1.0]}}}, "ascend"),
        ({"probes": {"lighting": {"severities": [0.0]}}}, "greater than 0"),
        ({"alpha": 1.0}, "less than 1"),
    ],
)
def test_what_cannot_be_is_refused(changes, says):
    with pytest.raises(ValidationError, match=says):
        MonitorsSettings(**GOOD | changes)
