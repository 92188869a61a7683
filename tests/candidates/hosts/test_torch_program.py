import numpy as np
import pytest
import torch
from torch import nn

from genpolicy.candidates.hosts.ports import Port
from genpolicy.candidates.hosts.torch_program import TorchProgram
from genpolicy.errors import ContractError, IntegrityError
from tests.candidates.hosts.conftest import Tiny, exported, replant


def loaded(data, threads=1):
    return TorchProgram(data, where="policy.pt2", threads=threads)


class Of(nn.Module):
    """A module of a function."""

    def __init__(self, function):
        super().__init__()
        self.function = function

    def forward(self, x):
        return self.function(x)


def test_it_says_what_it_takes_and_gives(torch_data):
    program = loaded(torch_data)
    assert program.inputs == {
        "observation": Port((2, 24), "float64"), "noise": Port((16, 10), "float32"),
    }  # fmt: skip
    assert program.output == Port((16, 10), "float32")


def test_it_computes_what_the_module_computes(torch_data):
    rng = np.random.default_rng(0)
    seen, noise = rng.normal(size=(2, 24)), rng.normal(size=(16, 10)).astype(np.float32)
    with torch.no_grad():
        expected = Tiny()(torch.from_numpy(seen), torch.from_numpy(noise)).numpy()
    found = loaded(torch_data).run({"noise": noise, "observation": seen})
    assert found.tobytes() == expected.tobytes()


def test_numbers_that_json_has_no_word_for_and_texts_of_operators_are_read():
    def masked(x):
        filled = x.masked_fill(x < 0, -float("inf"))
        return torch.einsum("ab,cb->ac", torch.nn.functional.gelu(x), x) + filled.softmax(-1)

    rows = np.arange(9, dtype=np.float32).reshape(3, 3) - 2
    program = loaded(exported(Of(masked), torch.zeros(3, 3)))
    expected = masked(torch.from_numpy(rows)).numpy()
    assert np.allclose(program.run({"x": rows}), expected, atol=1e-6)


def test_uses_of_a_weight_are_counted_in_the_graph(torch_data):
    program = loaded(torch_data)
    assert program.uses("layer.weight") == 2
    assert program.uses("layer.nothing") is None


def test_threads_and_kernels_are_those_of_before_after_a_run(torch_data):
    program, before = loaded(torch_data, threads=2), torch.get_num_threads()
    program.run({"observation": np.zeros((2, 24)), "noise": np.zeros((16, 10), np.float32)})
    assert torch.get_num_threads() == before
    assert torch.get_deterministic_debug_mode() == 0


@pytest.mark.parametrize(
    ("function", "found"),
    [
        (torch.rand_like, "aten.rand_like"),
        (lambda x: x + torch.randn(3), "aten.randn"),
        (lambda x: (x, x + 1), "2 outputs"),
    ],
)
def test_what_draws_by_itself_or_gives_more_than_one_array_is_refused(function, found):
    with pytest.raises(ContractError) as error:
        loaded(exported(Of(function), torch.zeros(3)))
    assert found in error.value.found


def test_what_torch_cannot_read_is_one_sentence(torch_data):
    with pytest.raises(IntegrityError, match="can read"):
        loaded(replant(torch_data, {"models/model.json": b'{"graph_module": {}}'}))
