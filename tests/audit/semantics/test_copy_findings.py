"""What is said of copies: whose they are, how many of how many, and where episodes were joined."""

import pytest
from arms import SETTINGS, arms, some
from joining import copied, joined, kinds

from genpolicy.audit.semantics import measure


@pytest.mark.parametrize(
    "how", [{}, {"late": 5}, {"keep": 0.7}, {"noise": 5e-5}, {"late": 3, "keep": 0.8}]
)
def test_copies_are_named(how):
    found = measure(copied(arms(50), 0.1, **how), SETTINGS)
    assert [finding.kind for finding in found.findings] == ["duplicate"]
    assert "6 of 66 episodes are copies" in found.findings[0].action


@pytest.mark.parametrize("share", [0.1, 1.0])
def test_episodes_glued_to_themselves_are_named(share):
    data = arms(53)
    found = kinds(joined(data, some(data, share), lambda k: k))
    assert found and set(found) == {"glued"}


def test_episodes_glued_to_the_next_are_named_and_no_clock():
    data = arms(54)
    found = kinds(joined(data, some(data, 0.3), lambda k: k + 1))
    assert found[0] == "glued" and set(found) <= {"glued", "duplicate"}
