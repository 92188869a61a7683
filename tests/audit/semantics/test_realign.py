"""Offsets taken out again, so that modes can be counted anew."""

from arms import SETTINGS, arms, late, some

from genpolicy.audit.semantics import measure, realigned


def kinds(data, settings=SETTINGS):
    return [finding.kind for finding in measure(data, settings).findings]


def test_a_minority_of_late_episodes_is_named_and_put_right():
    data = arms(12)
    chosen = some(data, 0.15)
    found = measure(late(data, 2.0, chosen), SETTINGS)
    assert [finding.kind for finding in found.findings] == ["clock"]
    assert f"{chosen.sum()} of" in found.findings[0].action
    assert found.shift_rows.tolist() == (2 * chosen).tolist()
    shifted, moved = realigned(late(data, 2.0, chosen), found)
    assert moved and kinds(shifted) == []
