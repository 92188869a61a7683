"""What a distillation took, in words and against a plain training."""

import pytest

from gates.distilled import operations_ratio, spent
from genpolicy.evidence.documents.given import Distilled


def test_a_distillation_costs_as_its_networks_are_asked_by_hand():
    """A window: the teacher's training one evaluation and its way back, 3; the student's three
    evaluations and one way back, 5; together 8 over 3."""
    said = Distilled("diffusion", "c" * 64, updates=8000, evaluations=4000, gradients=2000)
    assert operations_ratio(said) == pytest.approx(8 / 3)
    assert spent(said).startswith("distilled from diffusion cccccccccccccccc…: 8000 updates")
    assert "about 2.67 times" in spent(said)


def test_a_student_without_evaluations_of_its_own_would_cost_as_much_as_its_teacher():
    twice = Distilled("diffusion", "c" * 64, updates=2, evaluations=2, gradients=2)
    assert operations_ratio(twice) == pytest.approx(2.0)
