import numpy as np
import pytest

from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.hosts.ports import Port, check_ports, chunk_of
from genpolicy.errors import ContractError

SEEN, DRAWN, CHUNK = Port((2, 24), "float64"), Port((16, 10), "float32"), Port((16, 10), "float32")


class Planted:
    """What a loaded program says of itself."""

    def __init__(self, output=CHUNK, **inputs):
        self.inputs = inputs or {"observation": SEEN, "noise": DRAWN}
        self.output = output


@pytest.fixture
def entry(written):
    return read_entry(written("torch"))


@pytest.mark.parametrize(
    "program",
    [
        Planted(),
        Planted(Port((1, 16, 12), "float64")),
        Planted(observation=Port((1, 2, 24), "float64"), noise=Port((None, 16, 10), "float32")),
        Planted(Port((None, None, None), "float32"), observation=Port((2, None), "float64"),
                noise=DRAWN),
    ],
)  # fmt: skip
def test_what_fits(entry, program):
    check_ports(entry, program, None, {"observation": 24})
    check_ports(entry, program, None, {})


@pytest.mark.parametrize(
    ("program", "found", "expected"),
    [
        (Planted(state=SEEN, noise=DRAWN), "state, noise", "observation, noise, as its entry says"),
        (Planted(observation=SEEN), "observation", "observation, noise"),
        (
            Planted(observation=Port((2, 25), "float64"), noise=DRAWN),
            "float64 (2, 25)", "float64 (2, 24), as its entry says",
        ),
        (
            Planted(observation=Port((24,), "float64"), noise=DRAWN),
            "float64 (24)", "float64 (2, 24)",
        ),
        (
            Planted(observation=Port((2, 2, 24), "float64"), noise=DRAWN),
            "float64 (2, 2, 24)", "float64 (2, 24)",
        ),
        (
            Planted(observation=Port((2, 24), "float32"), noise=DRAWN),
            "float32 (2, 24)", "float64 (2, 24)",
        ),
        (
            Planted(observation=SEEN, noise=Port((8, 10), "float32")),
            "float32 (8, 10)", "float32 (16, 10)",
        ),
        (Planted(Port((8, 10), "float32")), "float32 (8, 10)", "(16, at least 10)"),
        (Planted(Port((16, 9), "float32")), "float32 (16, 9)", "(16, at least 10)"),
        (Planted(Port((16,), "float32")), "float32 (16)", "(16, at least 10)"),
        (Planted(Port((2, 16, 10), "float32")), "float32 (2, 16, 10)", "(16, at least 10)"),
        (Planted(Port((16, 10), "int64")), "int64 (16, 10)", "floating-point"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_with_both_sides(entry, program, found, expected):
    with pytest.raises(ContractError) as error:
        check_ports(entry, program, None, {"observation": 24})
    assert error.value.found == found
    assert expected in error.value.expected


def test_an_encoder_takes_the_observation_and_the_program_what_it_gives(written):
    entry = read_entry(written("torch", encoder={"program": "encoder.pt2", "gives": "condition"}))
    condition = Port((8,), "float32")
    encoder = Planted(condition, observation=SEEN)
    program = Planted(condition=condition, noise=DRAWN)
    check_ports(entry, program, encoder, {"observation": 24})
    for wrong in (Planted(), Planted(condition=Port((9,), "float32"), noise=DRAWN)):
        with pytest.raises(ContractError, match=r"policy\.pt2"):
            check_ports(entry, wrong, encoder, {})
    with pytest.raises(ContractError, match=r"encoder\.pt2"):
        check_ports(entry, program, Planted(), {})


def test_a_chunk_loses_its_batch_axis_and_nothing_else_is_one(entry):
    chunk = np.zeros((16, 10))
    assert chunk_of(chunk[None], entry, said_by="it").shape == (16, 10)
    for wrong in (chunk[:8], chunk[:, :9], np.zeros((2, 16, 10)), np.zeros(16)):
        with pytest.raises(ContractError, match="the answer of it"):
            chunk_of(wrong, entry, said_by="it")


def test_an_array_gets_the_batch_axis_that_a_program_wants():
    array = np.zeros((16, 10))
    assert Port((1, 16, 10), "float64").given(array).shape == (1, 16, 10)
    assert Port((16, 10), "float64").given(array) is array
