"""What a doubt names, and how many more there are."""

import pytest

from gates.doubt import named


@pytest.mark.parametrize(("count", "said"), [
    (1, "a"), (3, "a, b, c"), (4, "a, b, c and 1 more"), (6, "a, b, c and 3 more"),
])  # fmt: skip
def test_three_are_named_and_the_others_counted(count, said):
    assert named("abcdef"[:count]) == said
