"""The chapter's order, and the place of every criterion in it."""

import pytest

from gates.criterion import Criterion
from gates.diagnosis.places import HEADS, PLACES, WITHOUT_HEAD, place_of
from gates.diagnosis.reports import OF_EVIDENCE
from gates.proof import SPECS

CHAPTER = (
    "data semantics → multimodality → conditioning → generator training → sampler/solver → "
    "timing/queue → feasibility → contact controller → evaluator"
)
"""Section 7, by hand."""


def test_the_order_is_the_chapters():
    for place, said in zip(PLACES, CHAPTER.split(" → "), strict=True):
        assert place.split()[0] == said.replace("/", " ").split()[0]


def test_every_criterion_of_measured_evidence_has_a_place():
    every = [item for gate in OF_EVIDENCE for item in SPECS[gate].criteria]
    assert {place_of(item) for item in every} == set(PLACES)


def test_every_head_is_one_that_a_criterion_begins_with():
    heads = {
        item.look_at.partition(":")[0] for gate in OF_EVIDENCE for item in SPECS[gate].criteria
    }
    assert set(HEADS) <= heads
    assert set(WITHOUT_HEAD) == {
        item.id
        for gate in OF_EVIDENCE
        for item in SPECS[gate].criteria
        if item.look_at.partition(":")[0] not in HEADS
    }


def test_a_criterion_that_names_no_place_is_our_mistake_and_no_guess():
    def odd():
        """Nothing."""

    with pytest.raises(KeyError, match="Somewhere"):
        place_of(Criterion(odd, "Why?", "Somewhere: look.", "<=", False, False, None))
