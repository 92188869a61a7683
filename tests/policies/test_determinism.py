"""Deterministic computing: a row keeps its bits whatever its company."""

import subprocess
import sys
from collections.abc import Callable, Iterator

import pytest
import torch

from genpolicy.errors import ConfigError
from genpolicy.policies import determinism
from genpolicy.policies.determinism import deterministic
from genpolicy.policies.methods import METHODS
from genpolicy.policies.networks import (
    Dimensions,
)
from genpolicy.policies.policy import load_policy
from genpolicy.policies.settings import HeadConfig, NetworkConfig


@pytest.mark.parametrize("method", list(METHODS))
@pytest.mark.parametrize("rows", [8, 16, 64])
def test_a_row_keeps_its_bits_at_every_place_of_a_batch(method, rows):
    dimensions = Dimensions(
        observation_horizon=2,
        observation_dim=24,
        prediction_horizon=16 if METHODS[method].chunked else 1,
        action_dim=10,
    )
    generator = torch.Generator().manual_seed(1)
    network = METHODS[method].build(dimensions, NetworkConfig(), HeadConfig())
    observations = torch.randn(1, 2, 24, generator=generator).expand(rows, -1, -1).contiguous()
    reads = METHODS[method].reads
    values = time = None
    if reads == "latent":
        values = (
            torch.randn(1, HeadConfig().latent_dim, generator=generator)
            .expand(rows, -1)
            .contiguous()
        )
    elif reads == "chunk":
        values = torch.randn(1, 16, 10, generator=generator).expand(rows, -1, -1).contiguous()
        time = torch.full((rows,), 0.37)
    elif reads == "codes":
        values = torch.randn(1, 32, HeadConfig().code_dim, generator=generator)
        values = values.expand(rows, -1, -1).contiguous()
    with deterministic("cpu"), torch.inference_mode():
        out = network.evaluate(network.encode(observations), values, time)
    assert all(torch.equal(out[0], row) for row in out)


@pytest.mark.parametrize("device", ["cuda:99", "mps", "gpu", ""])
def test_a_device_that_is_not_there_is_a_bad_setting(device: str) -> None:
    with (
        pytest.raises(ConfigError, match=r"compute\.device is .*expected cpu") as caught,
        determinism.deterministic(device),
    ):
        pass
    assert caught.value.exit_code == 2


def test_without_a_gpu_cuda_is_a_bad_setting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    with pytest.raises(ConfigError, match="'cuda', which this machine does not have") as caught:
        determinism.require_device("cuda")
    assert caught.value.where == "params.yaml: compute.device"
    with pytest.raises(ConfigError, match=r"^--device is 'cuda', which .* Name one of these"):
        determinism.require_device("cuda", where="--device")
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    determinism.require_device("cuda")
    determinism.require_device("cuda:0")
    with pytest.raises(ConfigError):
        determinism.require_device("cuda:1")


def test_the_regime_is_left_as_it_was_found() -> None:
    before = torch.get_deterministic_debug_mode()
    try:
        torch.set_deterministic_debug_mode("warn")
        with deterministic("cpu"):
            assert torch.get_deterministic_debug_mode() == 2
            assert torch.are_deterministic_algorithms_enabled()
            assert not torch.is_deterministic_algorithms_warn_only_enabled()
        assert torch.get_deterministic_debug_mode() == 1
    finally:
        torch.set_deterministic_debug_mode(before)


def states() -> list[str]:
    """Of the older switch, where torch tells it, and of both newer ones."""
    backends = torch.backends
    try:
        named = torch.get_float32_matmul_precision()
    except RuntimeError:
        named = "in conflict"
    return [named, backends.cuda.matmul.fp32_precision, backends.mkldnn.matmul.fp32_precision]


def newer(part: str, precision: str) -> Callable[[], None]:
    own = getattr(torch.backends, part).matmul
    return lambda: setattr(own, "fp32_precision", precision)


@pytest.fixture
def switches() -> Iterator[None]:
    """torch's switches for products of fewer bits, as they are in a fresh process."""
    yield
    torch.set_float32_matmul_precision("highest")
    for own in (torch.backends.cuda.matmul, torch.backends.mkldnn.matmul):
        own.fp32_precision = "none"
    assert states() == ["highest", "none", "none"]


LOOSENED = [
    lambda: torch.set_float32_matmul_precision("high"),
    lambda: torch.set_float32_matmul_precision("medium"),
    newer("cuda", "tf32"),
    newer("mkldnn", "bf16"),
]


@pytest.mark.usefixtures("switches")
@pytest.mark.parametrize("loosen", LOOSENED, ids=["high", "medium", "newer tf32", "newer bf16"])
def test_products_are_of_float32_whatever_the_process_allows(folders, loosen, two_mode_windows):
    """On processors with bfloat16 products `medium` gave other samples of the same weights."""
    policy, seen = load_policy(folders["flow"]), two_mode_windows(40).observations
    names = [("row", row) for row in range(40)]
    expected = policy.sample(seen, noise_names=names, candidates=2).actions
    loosen()
    before = states()
    assert {"tf32", "bf16"} & set(before)
    with deterministic("cpu"):
        assert states() == ["highest", "ieee", "ieee"]
    assert states() == before
    found = policy.sample(seen, noise_names=names, candidates=2).actions
    assert found.tobytes() == expected.tobytes()
    assert load_policy(folders["flow"]).sample(
        seen, noise_names=names, candidates=2
    ).actions.tobytes() == expected.tobytes()  # fmt: skip


def test_the_record_names_the_card_of_a_cuda_device_and_of_no_other(monkeypatch) -> None:
    monkeypatch.setattr(torch.cuda, "get_device_name", lambda _: "A100")
    assert {"torch", "device", "cpu_capability", "threads"} == set(determinism.regime("cpu"))
    assert determinism.regime("cuda:0")["card"] == "A100"
    assert "card" not in determinism.regime("cpu:0")


def test_another_name_of_the_cpu_has_nothing_to_wait_for(folders) -> None:
    """torch knows how to wait for CUDA devices only, and a wheel without them raises."""
    load_policy(folders["flow"], device="cpu:0").synchronise()


@pytest.mark.parametrize("method", ["diffusion", "ibc"])
def test_a_process_that_samples_imports_no_compiler(folders, method) -> None:
    """A second of the first call for a flag of a compiler that nothing uses, and a third of one of
    the loading for weights that were made empty first: both were what a fresh process took."""
    program = (
        "import sys, torch\n"
        "from pathlib import Path\n"
        "import numpy as np\n"
        "from genpolicy.policies.determinism import deterministic\n"
        "from genpolicy.policies.policy import load_policy\n"
        "with deterministic('cpu'):\n"
        "    assert torch.are_deterministic_algorithms_enabled()\n"
        "policy = load_policy(Path(sys.argv[1]))\n"
        "policy.sample(np.zeros((1, 2, 3)), noise_names=[('a',)], candidates=2)\n"
        "print(*sorted({'torch._inductor', 'torch._dynamo', 'sympy'} & set(sys.modules)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(folders[method])],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.split() == []
