import numpy as np
import pytest

from genpolicy.candidates.hosts.hosted import HostedPolicy, files_sha256
from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.wire.extension import WORD, capabilities
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.errors import ContractError
from genpolicy.seeds import counter_noise
from tests.candidates.hosts.conftest import NOISE

WIDTHS = {"observation": 24}


def moved(given):
    return given["noise"] + given["observation"].sum()


@pytest.fixture
def entry(written):
    return read_entry(written("torch"))


def asked(**changes):
    said = {"invocation": "1", "noise": ["a", 1], "candidates": 3, **changes}
    return {"observation": np.ones((2, 24)), WORD: said}


def test_noise_is_that_of_our_policies_by_name_and_candidate(entry):
    hosted = HostedPolicy(entry, lambda given: given["noise"], widths=WIDTHS)
    found = hosted.answer(asked())["actions"]
    expected = [
        counter_noise((files_sha256(entry), "a", 1, row, 0), shape=(16, 10)) for row in range(3)
    ]
    assert found.tobytes() == np.stack(expected).tobytes()
    assert (hosted.answer(asked())["actions"] == found).all()
    assert (hosted.answer(asked(noise=["a", 2]))["actions"] != found).all()


def test_the_stream_of_an_export_is_its_checkpoints(written):
    noise = {**NOISE, "stream": "a" * 64, "steps": 2}
    entry = read_entry(written("torch", noise=noise))
    hosted = HostedPolicy(entry, lambda given: given["noise"][1], widths=WIDTHS)
    expected = counter_noise(("a" * 64, "a", 1, 0, 1), shape=(16, 10))
    assert (hosted.answer(asked(candidates=1))["actions"][0] == expected).all()


def test_it_says_what_it_measures_and_counts_and_no_more(entry):
    told = capabilities(HostedPolicy(entry, moved, widths=WIDTHS).metadata)
    assert (told.spans, told.counts_evaluations) == (("preprocess", "sample"), False)
    said = HostedPolicy(entry, moved, widths=WIDTHS).answer(asked())[WORD]
    assert set(said["spans_s"]) == {"preprocess", "sample"}
    assert "nfe" not in said
    whole = HostedPolicy(
        entry, lambda given: given["noise"] + given["condition"], evaluations=2, widths=WIDTHS,
        encode=lambda given: {"condition": given["observation"].sum()},
    )  # fmt: skip
    assert capabilities(whole.metadata).spans == ("preprocess", "encode", "sample")
    answer = whole.answer(asked())
    assert set(answer[WORD]["spans_s"]) == {"preprocess", "encode", "sample"}
    assert answer[WORD]["nfe"] == 2
    plain = HostedPolicy(entry, moved, widths=WIDTHS).answer(asked())
    assert (answer["actions"] == plain["actions"]).all()


def test_behind_the_wire_it_is_a_policy_like_others(entry, entry_of, serving, task):
    hosted = HostedPolicy(entry, moved, evaluations=2, widths={"observation": task.observation.dim})
    seen = np.ones((2, task.observation.dim))
    with serving(hosted.answer, hosted.metadata) as address:
        remote = RemotePolicy(entry_of(), address, task.observation)
        found = remote.invoke(seen, noise=("s", 5), candidates=4)
        remote.close()
    assert found.actions.shape == (4, 16, 10)
    assert found.evaluations == 2


def test_a_plain_client_gets_one_chunk_of_a_fixed_sequence(entry):
    hosted = HostedPolicy(entry, moved, widths=WIDTHS)
    drawn = [hosted.answer({"observation": np.ones((2, 24))})["actions"] for _ in range(2)]
    assert drawn[0].shape == (16, 10)
    assert (drawn[0] != drawn[1]).any()
    again = HostedPolicy(entry, moved, widths=WIDTHS)
    assert (again.answer({"observation": np.ones((2, 24))})["actions"] == drawn[0]).all()


@pytest.mark.parametrize(
    ("value", "found"),
    [
        (None, "NoneType"),
        (np.zeros((2, 23)), "float64 (2, 23)"),
        (np.zeros((1, 2, 24)), "float64 (1, 2, 24)"),
        (np.zeros((2, 24), np.float32), "float32 (2, 24)"),
    ],
)
def test_a_message_that_is_none_is_refused(entry, value, found):
    hosted = HostedPolicy(entry, moved, widths=WIDTHS)
    with pytest.raises(ContractError) as error:
        hosted.answer({"observation": value})
    assert error.value.found == found


def test_an_answer_that_is_no_chunk_is_refused(entry):
    with pytest.raises(ContractError, match=r"of shape \(15, 10\)"):
        HostedPolicy(entry, lambda given: given["noise"][1:], widths=WIDTHS).answer(asked())
