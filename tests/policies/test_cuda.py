"""What `compute.device` promises, asked of a CUDA device; skipped where this machine has none.

Bits are promised within a device, never between two: what a CPU and a GPU draw of the same weights
is compared within a tolerance. Weights that were trained on either are loaded on the other.
"""

import json
import subprocess
import sys
import time

import numpy as np
import pytest
import torch

from genpolicy.evidence.reproducibility.measure import in_fresh_process
from genpolicy.policies.checkpoint import load_checkpoint
from genpolicy.policies.density import log_density
from genpolicy.policies.determinism import deterministic
from genpolicy.policies.methods import METHODS
from genpolicy.policies.ode_samplers import ADAPTIVE_TABLEAUS
from genpolicy.policies.policy import NetworkPolicy, load_policy
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.training import train

DEVICE = "cuda"
pytestmark = pytest.mark.skipif(
    not torch.cuda.is_available(), reason="torch finds no CUDA device on this machine"
)

APART = 1e-5
"""Largest difference of a CPU's and a GPU's samples of equal weights. Actions here reach from -1 to
1. An adaptive solver chooses its steps by a difference of two rounded numbers: other roundings are
other steps, and no two ways are closer than its own tolerance."""
UPDATES = 200
FILES = ("model.safetensors", "config.json", "training.json", "metrics.jsonl")
TRAINED = ("flow", "diffusion", "chunked_bc", "act", "ibc", "flow_policy", "manicm", "bc_noise")
STEPS = {"ddpm": 100, "derivative_free": 6, "langevin": 12, "consistency": 2}
SAMPLERS = [
    (name, sampler)
    for name in ("bc", "chunked_bc", "act", "diffusion", "flow", "flow_policy", "manicm", "ibc")
    for sampler in METHODS[name].samplers
]
SLEEP_CYCLES, SLEEP_S = 400_000_000, 0.1
"""A GPU of 2 GHz sleeps so many cycles in 0.2 s; none has a clock of 4 GHz."""
DRAW = """
import hashlib, sys
from pathlib import Path
import numpy as np
from genpolicy.policies.policy import load_policy

policy = load_policy(Path(sys.argv[1]), device=sys.argv[2])
seen = np.load(sys.argv[3])
names = [("row", index) for index in range(len(seen))]
drawn = policy.sample(seen, noise_names=names, candidates=3).actions
print(hashlib.sha256(drawn.tobytes()).hexdigest())
"""


def sampler_of(name):
    single = name in ("direct", "z_zero", "z_prior", "offset")
    return SamplerConfig(
        name=name, steps=1 if single else STEPS.get(name, 4),
        population=32 if name in ("derivative_free", "langevin") else 1,
        nfe_cap=400 if name == "bosh3" else None,
    )  # fmt: skip


def names(count):
    return [("row", index) for index in range(count)]


def disturb():
    """Another state of the device: its generator, and what its memory holds and where."""
    torch.manual_seed(99)
    if torch.cuda.is_available():
        torch.cuda.manual_seed_all(99)
    return torch.randn(977, 131, device=DEVICE) @ torch.randn(131, 7, device=DEVICE)


@pytest.mark.parametrize("method", TRAINED)
def test_two_trainings_make_the_same_bytes_and_another_seed_others(
    tmp_path, method, request_for, two_mode_windows
):
    windows = two_mode_windows()
    weights_of = METHODS[method].rests_on
    for name, seed in (("one", 3), ("again", 3), ("other", 4)):
        beside = None
        if weights_of is not None:
            beside = tmp_path / f"{name}_before"
            before = request_for(weights_of, seed=seed, updates=UPDATES)
            train(beside, before, windows=windows, device=DEVICE)
        train(
            tmp_path / name, request_for(method, seed=seed, updates=UPDATES), windows=windows,
            validation=windows, device=DEVICE, weights_of=beside,
        )  # fmt: skip
        disturb()
    for file in FILES:
        one = (tmp_path / "one" / file).read_bytes()
        assert (tmp_path / "again" / file).read_bytes() == one
        # Of weights that were taken over no update is recorded, whatever the seed.
        if METHODS[method].weights_of is None or file == "model.safetensors":
            assert (tmp_path / "other" / file).read_bytes() != one


def test_another_process_trains_the_same_bytes(tmp_path, request_for, two_mode_windows):
    windows, request = two_mode_windows(), request_for("diffusion", updates=UPDATES)
    here = train(tmp_path / "here", request, windows=windows, device=DEVICE)
    there = in_fresh_process(train, tmp_path / "there", request, windows=windows, device=DEVICE)
    assert here == there


def test_what_draws_no_noise_is_trained_to_nearly_the_same_on_either(
    tmp_path, request_for, two_mode_windows
):
    """Regression sees the same batches; methods with noise draw it from the device's generator."""
    found = {}
    for device in ("cpu", DEVICE):
        request = request_for("chunked_bc", updates=UPDATES)
        train(tmp_path / device, request, windows=two_mode_windows(), device=device)
        record = json.loads((tmp_path / device / "training.json").read_text())
        assert record["regime"]["device"] == device
        found[device] = record["final"]["training_loss"]
    assert found["cpu"] == pytest.approx(found[DEVICE], rel=1e-3)


@pytest.mark.parametrize("method", TRAINED[:4])
def test_what_is_trained_there_is_loaded_on_the_cpu(
    tmp_path, method, request_for, two_mode_windows
):
    request = request_for(method, updates=UPDATES)
    train(tmp_path / "there", request, windows=two_mode_windows(), device=DEVICE)
    record = json.loads((tmp_path / "there" / "training.json").read_text())
    assert record["regime"]["device"] == DEVICE
    network = load_checkpoint(tmp_path / "there").network
    assert {values.device.type for values in network.state_dict().values()} == {"cpu"}
    near(tmp_path / "there", None, two_mode_windows(8, seed=9).observations)


@pytest.mark.parametrize(("method", "sampler"), SAMPLERS, ids=lambda word: word)
def test_weights_of_the_cpu_draw_there_what_they_draw_on_it(
    folders, method, sampler, two_mode_windows
):
    near(folders[method], sampler_of(sampler), two_mode_windows(8, seed=9).observations)


def near(folder, sampler, observations):
    here, there = (
        load_policy(folder, sampler=sampler, device=device).sample(
            observations, noise_names=names(len(observations)), candidates=2
        )
        for device in ("cpu", DEVICE)
    )
    adaptive = sampler is not None and sampler.name in ADAPTIVE_TABLEAUS
    assert adaptive or here.nfe == there.nfe
    most = sampler.tolerance if adaptive else APART
    assert float(np.abs(here.actions - there.actions).max()) <= most
    assert float(np.ptp(there.actions)) > 0.0


@pytest.mark.parametrize(("method", "sampler"), SAMPLERS, ids=lambda word: word)
def test_a_row_depends_on_neither_company_nor_place_nor_load(
    folders, method, sampler, two_mode_windows
):
    policy = load_policy(folders[method], sampler=sampler_of(sampler), device=DEVICE)
    seen = two_mode_windows(40, seed=9).observations
    together = policy.sample(seen, noise_names=names(40), candidates=3).actions
    disturb()
    again = load_policy(folders[method], sampler=sampler_of(sampler), device=DEVICE)
    for row in (0, 17, 39):
        for count in (1, 3, 8):
            alone = again.sample(
                seen[row : row + 1], noise_names=[("row", row)], candidates=count
            ).actions[0]
            assert np.array_equal(alone[:3], together[row][:count])
    order = np.random.default_rng(0).permutation(40)
    shuffled = again.sample(
        seen[order], noise_names=[("row", int(row)) for row in order], candidates=3
    )
    assert np.array_equal(shuffled.actions, together[order])


@pytest.mark.parametrize(("method", "sampler"), [("flow", "heun"), ("diffusion", "ddim")])
def test_a_guided_chunk_is_drawn_there_too(folders, method, sampler, two_mode_windows):
    """Guidance differentiates the network: its backward pass must keep a row's bits as well."""
    seen = two_mode_windows(20, seed=9).observations
    weights = np.zeros((20, 4))
    weights[::2, :2] = 1.0
    prefix = Prefix(np.full((20, 4, 2), 0.3), weights, bound=5.0)
    here, there = (
        load_policy(folders[method], sampler=sampler_of(sampler), device=device)
        for device in ("cpu", DEVICE)
    )
    own = there.sample(seen, noise_names=names(20), candidates=2, prefix=prefix).actions
    expected = here.sample(seen, noise_names=names(20), candidates=2, prefix=prefix).actions
    assert float(np.abs(own - expected).max()) <= APART
    one = Prefix(prefix.actions[4:5], prefix.weights[4:5], bound=5.0)
    alone = there.sample(seen[4:5], noise_names=[("row", 4)], candidates=2, prefix=one).actions
    assert np.array_equal(alone[0], own[4])


@pytest.mark.parametrize("method", ["flow", "ibc"])
def test_two_processes_draw_the_same_bytes(folders, method, tmp_path, two_mode_windows):
    np.save(tmp_path / "seen.npy", two_mode_windows(20, seed=9).observations)
    words = [str(folders[method]), DEVICE, str(tmp_path / "seen.npy")]
    one, two = (
        subprocess.run(
            [sys.executable, "-c", DRAW, *words], capture_output=True, text=True, check=True
        ).stdout
        for _ in range(2)
    )
    assert one == two and len(one.strip()) == 64


def test_what_is_timed_is_finished(folders, two_mode_windows, monkeypatch):
    """A call returns when the work is queued; a clock that stopped there would flatter."""
    policy = load_policy(folders["flow"], device=DEVICE)
    seen = two_mode_windows(1, seed=9).observations
    policy.sample(seen, noise_names=names(1), candidates=1)
    honest = policy.checkpoint.network.encode

    def slow(observations):
        torch.cuda._sleep(SLEEP_CYCLES)
        return honest(observations)

    monkeypatch.setattr(policy.checkpoint.network, "encode", slow)
    begun = time.perf_counter()
    condition = policy.encode(policy.preprocess(seen))
    queued = time.perf_counter() - begun
    policy.synchronise()
    encoded = time.perf_counter() - begun
    assert encoded >= SLEEP_S and encoded - queued >= SLEEP_S / 2  # the rest was waited for
    begun = time.perf_counter()
    condition = policy.encode(policy.preprocess(seen))
    policy.sample_encoded(condition, noise_names=names(1), candidates=1)
    assert time.perf_counter() - begun >= SLEEP_S


def test_what_is_compiled_for_the_cpu_is_not_used_there(folders, monkeypatch, two_mode_windows):
    def refused(*_):
        raise AssertionError("compiled for the CPU")

    monkeypatch.setattr("genpolicy.policies.compiled_network.CompiledNetwork.finish", refused)
    policy = load_policy(folders["flow"], device=DEVICE)
    assert policy._compiled is None and policy._calls.sizes == (policy.sampler.batch_rows,)
    assert {values.device.type for values in policy.checkpoint.network.parameters()} == {
        torch.device(DEVICE).type
    }
    policy.sample(two_mode_windows(1).observations, noise_names=names(1), candidates=1)


def test_settings_of_the_caller_come_back(folders, two_mode_windows):
    before = torch.get_deterministic_debug_mode(), torch.get_num_threads()
    state = torch.cuda.get_rng_state(DEVICE)
    policy = load_policy(folders["diffusion"], device=DEVICE)
    policy.sample(two_mode_windows(1).observations, noise_names=names(1), candidates=1)
    assert (torch.get_deterministic_debug_mode(), torch.get_num_threads()) == before
    assert torch.equal(torch.cuda.get_rng_state(DEVICE), state)


@pytest.mark.parametrize("method", ["flow", "diffusion"])
def test_a_density_does_not_depend_on_where_the_policy_is(folders, method, two_mode_windows):
    windows = two_mode_windows(3, seed=9)
    here, there = (
        log_density(
            load_policy(folders[method], device=device), windows.observations, windows.actions
        )
        for device in ("cpu", DEVICE)
    )
    assert here.tobytes() == there.tobytes()


def test_another_sampler_of_a_loaded_policy_stays_there(folders, two_mode_windows):
    policy = load_policy(folders["flow"], device=DEVICE)
    other = NetworkPolicy(policy.checkpoint, sampler=sampler_of("midpoint"), device=policy.device)
    seen = two_mode_windows(2, seed=9).observations
    fresh = load_policy(folders["flow"], sampler=sampler_of("midpoint"), device=DEVICE)
    drawn = [one.sample(seen, noise_names=names(2), candidates=2).actions for one in (other, fresh)]
    assert drawn[0].tobytes() == drawn[1].tobytes()


@pytest.fixture
def whole_products():
    yield
    torch.set_float32_matmul_precision("highest")
    for own in (torch.backends.cuda.matmul, torch.backends.mkldnn.matmul):
        own.fp32_precision = "none"


def loosened(how):
    """Products by TF32, as programs allow them with torch's older switch, and its newer one."""
    if how == "older":
        torch.backends.cuda.matmul.allow_tf32 = True
    else:
        torch.backends.cuda.matmul.fp32_precision = "tf32"


@pytest.mark.usefixtures("whole_products")
@pytest.mark.parametrize("how", ["older", "newer"])
def test_products_are_of_float32_whatever_the_process_allows(
    folders, how, tmp_path, request_for, two_mode_windows
):
    left, right = (torch.randn(256, 256, device=DEVICE) for _ in range(2))
    whole = left @ right
    seen = two_mode_windows(8, seed=9).observations
    policy = load_policy(folders["flow"], device=DEVICE)
    drawn = policy.sample(seen, noise_names=names(8), candidates=2).actions
    request = request_for("flow", updates=20)
    made = train(tmp_path / "one", request, windows=two_mode_windows(), device=DEVICE)
    loosened(how)
    if how == "older":  # of the newer one alone torch refuses to multiply outside the regime
        assert not torch.equal(left @ right, whole), "this card has no TF32, nothing is shown"
    with deterministic(DEVICE):
        assert torch.equal(left @ right, whole)
    found = policy.sample(seen, noise_names=names(8), candidates=2).actions
    assert found.tobytes() == drawn.tobytes()
    assert train(tmp_path / "two", request, windows=two_mode_windows(), device=DEVICE) == made
    assert torch.backends.cuda.matmul.fp32_precision == "tf32"


def test_the_record_of_a_training_names_the_card(tmp_path, request_for, two_mode_windows):
    train(tmp_path / "one", request_for("flow", updates=2), windows=two_mode_windows(),
          device=DEVICE)  # fmt: skip
    record = json.loads((tmp_path / "one" / "training.json").read_text())["regime"]
    assert record["card"] == torch.cuda.get_device_name(DEVICE) and record["cuda"]
