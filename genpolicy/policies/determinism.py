"""The regime in which bits are promised: one thread, deterministic kernels, own generators."""

import contextlib
import os
from collections.abc import Iterator

import torch

from genpolicy.errors import ConfigError

# torch puts another object in the place of the module, which its types do not say.
_PRODUCTS = (torch.backends.cuda.matmul, torch.backends.mkldnn.matmul)  # type: ignore[attr-defined]
_FEWER_BITS = {"tf32", "bf16"}


def require_device(device: str, *, where: str = "params.yaml: compute.device") -> None:
    """Refuse a device that this machine does not have, and say who named it.

    Args:
        device: Torch device.
        where: Where it is named.

    Raises:
        ConfigError: No such device, or none of this kind.
    """
    if device == "cpu":
        return
    try:
        wanted = torch.device(device)
        count = {"cpu": 1, "cuda": torch.cuda.device_count()}.get(wanted.type, 0)
    except RuntimeError:
        count, wanted = 0, torch.device("cpu")
    if not (wanted.index or 0) < count:
        raise ConfigError(
            where=where,
            found=f"{device!r}, which this machine does not have",
            expected=f"cpu, or one of {torch.cuda.device_count()} CUDA devices",
            action="Name one of these, or run where the device is.",
        )


@contextlib.contextmanager
def deterministic(device: str) -> Iterator[None]:
    """One CPU thread, deterministic kernels and whole float32 products inside the block.

    The old settings come back after it.

    Args:
        device: `cpu`, or a CUDA device, whose matrix products then use a fixed workspace.

    Raises:
        ConfigError: This machine has no such device.
    """
    require_device(device)
    threads = torch.get_num_threads()
    # Sets the same flag as `use_deterministic_algorithms`, which imports torch's compiler to tell
    # it too: a second or more in the first call of every process, and nothing here is compiled.
    mode = torch.get_deterministic_debug_mode()
    if device != "cpu":
        os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    try:
        torch.set_deterministic_debug_mode("error")
        if threads != 1:
            torch.set_num_threads(1)
        with _whole_products():
            yield
    finally:
        torch.set_deterministic_debug_mode(mode)
        if threads != 1:
            torch.set_num_threads(threads)


@contextlib.contextmanager
def _whole_products() -> Iterator[None]:
    """Products of float32 in float32, whatever whoever shares the process allowed torch to do.

    A program, or the environment of a container, may let a GPU multiply by TF32 and a CPU by
    bfloat16: other bits, a thousandfold further from the sum, of what a card calls float32.
    """
    before = [own.fp32_precision for own in _PRODUCTS]
    if not _FEWER_BITS & set(before):
        yield
        return
    named = None
    # Of whoever used torch's newer switch the older one cannot be read, and was not moved.
    with contextlib.suppress(RuntimeError):
        named = torch.get_float32_matmul_precision()
    # The older switch moves both; torch refuses to multiply where they contradict each other.
    torch.set_float32_matmul_precision("highest")
    try:
        yield
    finally:
        if named is not None:
            torch.set_float32_matmul_precision(named)
        for own, precision in zip(_PRODUCTS, before, strict=True):
            own.fp32_precision = precision


@contextlib.contextmanager
def initial_weights(seed: int) -> Iterator[None]:
    """Weights made inside the block depend on `seed` only; the global generator is untouched."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        yield


def regime(device: str) -> dict[str, str | int]:
    """What bit equality rests on, for the record; of a CUDA device also which card it is."""
    capability = torch.backends.cpu.get_cpu_capability()
    card = {}
    if torch.device(device).type == "cuda":
        card = {"card": torch.cuda.get_device_name(device), "cuda": str(torch.version.cuda)}
    return {
        "torch": torch.__version__,
        "device": device,
        "cpu_capability": str(capability),
        "threads": 1,
        **card,
    }
