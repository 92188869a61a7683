"""The benchmark of training runs to its end with tiny sizes, and ends where ways differ."""

import itertools
import re

import numpy as np
import pytest
import torch

pytest.importorskip("diffusers")

from benchmarks.training import __main__ as training
from benchmarks.training import turns
from benchmarks.training.steps import METHODS, Ours, Products, Size, Start, layers_of, windows
from benchmarks.training.turns import InTurn, Spent, median, take_turns, with_threads

TINY = ["--width", "48", "--batch", "16"]
ONE = ["ours", "peer", "products"]
THREE = ["in turn", "vmap", "bmm", "3 products", "batched products"]


@pytest.fixture(scope="module")
def data():
    return windows()


def test_every_way_is_timed_for_every_number_of_threads(capsys, monkeypatch):
    """The check inside it asks that all ways train the same; it would end the process."""
    asked, real = [], turns.with_threads

    def noted(threads, *, fixed):
        asked.append((threads, fixed))
        return real(1, fixed=fixed)  # two that share a busy machine wait for each other

    monkeypatch.setattr(turns, "with_threads", noted)
    training.main([
        *TINY, "--methods", "chunked_bc", "diffusion", "--seeds-of", "diffusion",
        "--rounds", "1", "--updates", "1", "--widths", "48", "--batches", "16", "32",
        "--compared", "2",
    ])  # fmt: skip
    lines = capsys.readouterr().out.splitlines()
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line[:1] == "|"]
    timed = [tuple(row[:3]) for row in cells if row[0] in METHODS and len(row) == 7]
    assert timed == [
        *(("chunked_bc", way, threads) for threads in "12" for way in ONE),
        *(("diffusion", way, threads) for threads in "12" for way in ONE + THREE),
        ("diffusion", "2 processes", "1"),
    ]
    assert [row[:2] for row in cells if row[0].isdigit()] == [["48", "16"], ["48", "32"]]
    assert [row[:2] for row in cells if len(row) == 5][1:] == [
        ["---"] * 2, ["diffusion", "vmap"], ["diffusion", "bmm"],
    ]  # fmt: skip
    found = [float(number) for row in cells for number in re.findall(r"^([\d.]+) \[", row[3])]
    assert len(found) == len(timed) + 2 and all(number > 0.0 for number in found)
    # A stage's regime is that of ours and of what is stacked; peer and products have torch's own.
    assert {(threads, fixed) for threads in (1, 2) for fixed in (True, False)} == set(asked)
    told = [line for line in lines if "GFLOP" in line or "three seeds take" in line]
    assert [line.split(",")[0].split(":")[0] for line in told] == ["chunked_bc", *["diffusion"] * 3]


@pytest.mark.parametrize("method", METHODS)
def test_what_trains_something_else_ends_it(method, data, monkeypatch):
    own = training.Contenders(method, data, Size(48, 16))
    own.check()
    for name, way in (("peer", "Peer"), ("vmap", "Stacked")):
        with monkeypatch.context() as patch:
            kind = getattr(training, way)
            # The first updates, of a warm-up, move a weight by some 1e-5 in all.
            for by in (1e-2, 3e-6):
                patch.setattr(
                    training, way, lambda *given, kind=kind, by=by: moved(kind(*given), by)
                )
                with pytest.raises(SystemExit, match=f"{method}: {name} and ours differ"):
                    own.check()


def moved(way, by):
    """A way that begins with other weights."""
    with torch.no_grad():
        weights = way.current if hasattr(way, "current") else way.network.parameters()
        for weight in weights:
            weight.add_(by)
    return way


def test_each_seed_is_a_training_of_its_own(data):
    own = training.Contenders("flow", data, Size(48, 16))
    with with_threads(1, fixed=True):
        stack, alone = own.stacked("bmm"), [Ours(own.start(seed)) for seed in training.SEEDS]
        for run, _ in itertools.product([stack, *alone], range(3)):
            run()
    near = [[training.apart(stack.of_seed(place), training.averaged(one)) for one in alone]
            for place in range(3)]  # fmt: skip
    assert np.array_equal(np.array(near) < 1e-6, np.eye(3, dtype=bool))


def test_each_seed_is_clipped_by_its_own_norm(data):
    own = training.Contenders("flow", data, Size(48, 16))
    stack, alone = own.stacked("bmm"), [own.start(seed) for seed in training.SEEDS]
    for place, (start, size) in enumerate(zip(alone, (1e-3, 1e-1, 1.0), strict=True)):
        weights = list(start.network.parameters())
        for weight in weights:
            weight.grad = size * torch.randn(weight.shape)
        if place == 0:
            for whole in stack.current:
                whole.grad = torch.empty_like(whole)
        for whole, weight in zip(stack.current, weights, strict=True):
            whole.grad[place] = weight.grad
        norm = torch.nn.utils.clip_grad_norm_(weights, 1.0)
        assert (norm > 1.0) == (place > 0)
    stack._clip()
    for place, start in enumerate(alone):
        for whole, weight in zip(stack.current, start.network.parameters(), strict=True):
            assert torch.allclose(whole.grad[place], weight.grad, rtol=1e-5)


@pytest.mark.parametrize("method", METHODS)
def test_products_are_those_of_the_gradients_that_an_update_takes(method, data):
    start = Start(method, data, size=Size(48, 16))
    layers, network = layers_of(start), start.network
    matrices = {name: part for name, part in network.named_parameters() if part.ndim == 2}
    assert sorted((own.outputs, own.inputs) for own in layers) == sorted(
        tuple(part.shape) for part in matrices.values()
    )
    # Below the first layer behind observations, noisy chunk or time nothing wants a gradient.
    first = {"encoder.hidden.weight", "head.entry.weight", "head.time.0.weight"} & set(matrices)
    assert sum(not own.below for own in layers) == len(first)
    ends = sum(matrices[name].numel() for name in first)
    every = sum(part.numel() for part in matrices.values())
    assert sum(own.operations for own in layers) == 2 * 16 * (3 * every - ends)
    for copies in (1, 3):
        work = Products(layers, copies)
        work()
        one, other, out = work.work[0]
        assert len(work.work) == 3 * len(layers) - len(first)
        assert torch.allclose(out, one @ other, atol=1e-4)


def test_the_configured_size_is_that_of_the_ladder_and_others_keep_its_proportions(data):
    full = Start("diffusion", data)
    asked = full.request.training
    assert full.request.network == training.Start("diffusion", data, size=Size()).request.network
    assert (asked.batch_size, full.request.network.trunk_width) == (256, 384)
    head = Start("diffusion", data, size=Size(192, 64)).network.head
    assert full.network.head.branch_in.out_features == 2 * head.branch_in.out_features
    assert full.network.head.time[0].out_features == 2 * head.time[0].out_features


def test_ways_take_turns_and_the_first_round_is_dropped():
    asked = []

    class Told:
        def __init__(self, name):
            self.name, self.spent = name, iter([100.0, 1.0, 3.0, 2.0])

        def turn(self, updates):
            asked.append((self.name, updates))
            took = next(self.spent)
            return Spent(took, 2.0 * took)

    found = take_turns({"a": Told("a"), "b": Told("b")}, rounds=3, updates=5)
    assert asked == [("a", 5), ("b", 5)] * 4
    assert found["b"]["processor"].tolist() == [1.0, 3.0, 2.0]
    assert found["b"]["wall"].tolist() == [2.0, 6.0, 4.0]


def test_threads_and_regime_hold_inside_and_are_given_back():
    before = torch.get_num_threads(), torch.get_deterministic_debug_mode()
    for fixed in (True, False):
        with with_threads(before[0] + 1, fixed=fixed):
            assert torch.get_num_threads() == before[0] + 1
            assert torch.get_deterministic_debug_mode() == (2 if fixed else before[1])
        assert (torch.get_num_threads(), torch.get_deterministic_debug_mode()) == before


def test_a_turn_warms_each_part_and_counts_its_own_updates():
    done = []
    way = InTurn(
        [lambda: done.append("a"), lambda: done.append("b")],
    )
    assert all(number >= 0.0 for number in way.turn(3))
    assert "".join(done) == "aaaabbbb"


def test_a_price_is_reachable_out_of_reach_or_not_decided():
    def found(least):
        own = {"processor": np.linspace(least, least + 0.1, 11)}
        return {"ours, 1": {"processor": np.ones(11)}, "3 products, 1": own,
                "batched products, 1": {"processor": own["processor"] + 1.0}}  # fmt: skip

    said = [training.reachable(found(least), 1) for least in (1.2, 1.55, 2.0)]
    assert [re.search("below|above|not decided", line)[0] for line in said] == [
        "below", "not decided", "above",
    ]  # fmt: skip
    assert str(median(np.arange(1.0, 12.0))) == "6.00 [2.00, 10.00]"
