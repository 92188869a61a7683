"""Who had a choice, between what, and what each counts."""

import numpy as np
import pytest
from planar import SETTINGS, planar

from genpolicy.audit.choices import Choices, choices
from genpolicy.audit.data import canonical
from genpolicy.audit.situations import find_situations

N = 60


def test_who_had_no_choice_does_not_count():
    data = canonical(planar(episodes=N)[0])
    assert len(choices(data, [], np.full(N, -1, dtype=np.int64)).mode) == 0
    several = [(i, c) for _, i, c in find_situations(data, SETTINGS, 0)[0] if c.count > 1][:3]
    alone = np.zeros(N, dtype=np.int64)
    assert len(choices(data, several, alone).mode) == 0


def test_the_rare_of_those_who_saw_the_same_counts_more_and_chance_follows():
    share = np.array([[0.75, 0.25]] * 4)
    chosen = Choices(np.arange(4), np.array([0, 0, 0, 1]), share)
    assert chosen.weight == pytest.approx([4 / 3, 4 / 3, 4 / 3, 4.0])
    # Always the larger mode is right three times of four, and no skill.
    always = np.array([1.0, 1.0, 1.0, 0.0])
    assert chosen.weight @ always / chosen.weight.sum() == pytest.approx(chosen.chance) == 0.5
