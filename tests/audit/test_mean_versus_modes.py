"""The mean hits what the modes pass."""

from planar import SETTINGS

from genpolicy.audit.evidence import summary


def test_the_mean_hits_the_post_and_the_modes_do_not(valid):
    numbers = summary(valid, SETTINGS)
    assert numbers.mean_checked == valid.counts.two_mode
    several = [item for item in valid.situations if item.two_mode]
    assert all(all(item.chunks.mode_admissible) for item in several)
    # Where the sides are even the mean must hit; where one side rules it may pass by it.
    even = [item for item in several if min(item.clustering.sizes) >= 0.4 * 21]
    assert len(even) >= 5
    assert not any(item.chunks.mean_admissible for item in even)
    assert {item.chunks.mean_reason for item in even} == {"collision"}
    assert numbers.modes_before_realignment == numbers.modes_after_realignment
