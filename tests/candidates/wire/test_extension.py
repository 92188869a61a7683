import numpy as np
import pytest

from genpolicy.candidates.wire.extension import (
    WORD,
    Capabilities,
    capabilities,
    read_answer,
    request,
)
from genpolicy.candidates.wire.faults import Fault, PolicyError

SAID = {
    "version": 1, "checkpoint": "a" * 64, "sampler": "b" * 64, "prediction_horizon": 3,
    "seeded": True, "candidates": 4, "counts_evaluations": True, "spans": ["encode", "sample"],
}  # fmt: skip
ANSWER = {
    "actions": np.zeros((2, 3, 5)),
    WORD: {
        "invocation": "7", "checkpoint": "a" * 64, "sampler": "b" * 64, "nfe": 4,
        "spans_s": {"encode": 0.001, "sample": 0.02},
    },
}  # fmt: skip


def said(**changes):
    return {WORD: {**SAID, **changes}}


def answered(**changes):
    return {**ANSWER, WORD: {**ANSWER[WORD], **changes}}


def read(answer, told=None, candidates=2):
    told = capabilities(said()) if told is None else told
    return read_answer(answer, key="actions", told=told, invocation="7", candidates=candidates)


def test_a_server_that_never_heard_of_it_can_nothing_of_it():
    told = capabilities({"reset_pose": [0.0]})
    assert told == Capabilities()
    assert (told.version, told.seeded, told.candidates, told.checkpoint) == (0, False, 1, None)


def test_what_it_says_is_what_it_can():
    told = capabilities(said())
    assert told.model_dump() == {
        **SAID, "spans": ("encode", "sample"), "prefix": False, "samplers": (),
    }  # fmt: skip


@pytest.mark.parametrize(
    "changes",
    [
        {"version": 2}, {"version": "1"}, {"checkpoint": "A" * 64}, {"candidates": 0},
        {"spans": ["encoding"]}, {"spans": 3}, {"seeded": 1}, {"more": 1},
        {"prediction_horizon": 513},
    ],
)  # fmt: skip
def test_metadata_that_say_something_else_are_malformed(changes):
    with pytest.raises(PolicyError, match="its metadata") as error:
        capabilities(said(**changes))
    assert error.value.fault is Fault.MALFORMED


@pytest.mark.parametrize(("changes", "found", "expected"), [
    ("none of it", "genpolicy: 'none of it'", "a map"),
    ({"candidates": 0}, "genpolicy.candidates: 0", "greater than or equal to 1"),
    ({"seeded": "yes"}, "genpolicy.seeded: 'yes'", "valid boolean"),
    ({"checkpoint": "A" * 64}, f"genpolicy.checkpoint: '{'A' * 64}'", "match pattern"),
    ({"more": 1}, "genpolicy.more: 1", "one of version, checkpoint, sampler"),
    ({"spans": ["encoding"]}, "genpolicy.spans: 'encoding'", "latency terms: exposure, capture"),
    ({"spans": 3}, "genpolicy.spans: 3", "valid list"),
    ({"spans": "sample"}, "genpolicy.spans: 'sample'", "valid list"),
    ({"spans": ["sample", 3]}, "genpolicy.spans.1: 3", "valid string"),
    ({"version": 2}, "genpolicy.version: 2", "1, the version"),
    ({"sampler": "b" * 10_000}, f"genpolicy.sampler: '{'b' * 79}", "match pattern"),
])  # fmt: skip
def test_the_word_that_is_wrong_is_named_with_what_stands_there(changes, found, expected):
    """Red before: "1 validation error for Capabilities", and no word of which, nor of what."""
    metadata = said(**changes) if isinstance(changes, dict) else {WORD: changes}
    with pytest.raises(PolicyError) as error:
        capabilities(metadata)
    assert error.value.found == f"its metadata say {found}"
    assert expected in error.value.expected
    assert error.value.action.startswith("Correct `genpolicy")
    assert expected in str(error.value) and "msgpack" not in str(error.value)


@pytest.mark.parametrize("metadata", [{WORD: 1}, {WORD: [1]}, {WORD: "yes"}])
def test_metadata_that_are_no_map_are_malformed(metadata):
    with pytest.raises(PolicyError) as error:
        capabilities(metadata)
    assert error.value.fault is Fault.MALFORMED


def test_a_request_names_invocation_noise_and_number():
    assert request("7", ("stress", 3), 8) == {
        WORD: {"invocation": "7", "noise": ["stress", 3], "candidates": 8}
    }


def test_an_answer_with_what_was_counted():
    drawn = read(ANSWER)
    assert drawn.actions.shape == (2, 3, 5)
    assert drawn.evaluations == 4
    assert drawn.spans_s == {"encode": 0.001, "sample": 0.02}


def test_what_it_does_not_measure_is_unknown_and_not_zero():
    told = capabilities(said(counts_evaluations=False, spans=[]))
    drawn = read(answered(nfe=-3, spans_s="never"), told)
    assert drawn.evaluations is None
    assert drawn.spans_s == {}


def test_a_plain_answer_is_one_chunk():
    drawn = read({"actions": np.zeros((3, 5), dtype=np.float32)}, Capabilities(), candidates=1)
    assert drawn.actions.shape == (1, 3, 5)
    assert drawn.actions.dtype == np.float64
    assert drawn.evaluations is None


@pytest.mark.parametrize(
    ("answer", "fault"),
    [
        ({"actions": ANSWER["actions"]}, Fault.MALFORMED),
        (answered(invocation="6"), Fault.UNREQUESTED),
        (answered(invocation=7), Fault.UNREQUESTED),
        (answered(invocation=np.zeros(3)), Fault.UNREQUESTED),
        (answered(checkpoint=np.zeros(3)), Fault.CHANGED),
        (answered(checkpoint="c" * 64), Fault.CHANGED),
        (answered(checkpoint=None), Fault.CHANGED),
        (answered(sampler="c" * 64), Fault.CHANGED),
        (answered(nfe=0), Fault.MALFORMED),
        (answered(nfe=True), Fault.MALFORMED),
        (answered(nfe=2**31), Fault.MALFORMED),
        (answered(nfe=4.0), Fault.MALFORMED),
        (answered(spans_s={"encode": 0.001}), Fault.MALFORMED),
        (answered(spans_s={"encode": -0.001, "sample": 0.0}), Fault.MALFORMED),
        (answered(spans_s={"encode": float("nan"), "sample": 0.0}), Fault.MALFORMED),
        ({**ANSWER, "actions": [[1.0]]}, Fault.SHAPE),
        ({**ANSWER, "actions": np.zeros((3, 3, 5))}, Fault.SHAPE),
        ({**ANSWER, "actions": np.zeros((3, 5))}, Fault.SHAPE),
        ({**ANSWER, "actions": np.zeros((2, 0, 5))}, Fault.SHAPE),
        ({**ANSWER, "actions": np.zeros((2, 3, 5), dtype=bool)}, Fault.SHAPE),
        ({WORD: ANSWER[WORD]}, Fault.SHAPE),
    ],
)
def test_an_answer_that_is_not_what_was_asked_is_a_fault(answer, fault):
    with pytest.raises(PolicyError) as error:
        read(answer)
    assert error.value.fault is fault


def test_a_chunk_that_is_not_finite_is_left_to_feasibility():
    answer = {**ANSWER, "actions": np.full((2, 3, 5), np.nan)}
    assert np.isnan(read(answer).actions).all()


@pytest.mark.parametrize("own", ["b" * 64, None, 3, "d" * 64])
def test_another_setting_is_answered_under_one_hash_of_its_own(own):
    """Not that of the judged one, nor another one than before."""
    asked = {"key": "actions", "told": capabilities(said()), "invocation": "7", "candidates": 2}
    first = read_answer(answered(sampler="c" * 64), **asked, sampler="one")
    assert first.sampler == "c" * 64
    with pytest.raises(PolicyError) as error:
        read_answer(answered(sampler=own), **asked, sampler="one", settings=first.sampler)
    assert error.value.fault is Fault.CHANGED
