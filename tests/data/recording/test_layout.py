"""The layout of topics."""

from genpolicy.data.recording.layout import LAYOUT


def test_layout_topics_are_unique():
    names = [topic.name for topics in LAYOUT.values() for topic in topics]
    assert len(set(names)) == len(names)
