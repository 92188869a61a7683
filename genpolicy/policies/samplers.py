"""What every sampler knows of a policy: a network function that is counted, a noise function.

The number of network evaluations is counted by wrapping the network, never derived.
"""

from collections.abc import Callable
from typing import NoReturn

from torch import Tensor

from genpolicy.errors import ConfigError, EvaluationCapError

# (chunks (B, K, D), time (B,)) -> noise estimate or velocity (B, K, D)
NetworkFunction = Callable[[Tensor, Tensor], Tensor]
# sampler step -> standard normal (B, K, D); step 0 is the start
NoiseFunction = Callable[[int], Tensor]


class CountedNetwork:
    """A network function that counts its evaluations, and ends where no more are allowed.

    Attributes:
        nfe: Evaluations so far; one call is one evaluation, whatever its batch size, and so is one
            backward pass.
        cap: Largest number of them; None where nothing bounds it.
    """

    def __init__(self, network: NetworkFunction, *, cap: int | None = None) -> None:
        self._network = network
        self.nfe = 0
        self.cap = cap

    def __call__(self, chunks: Tensor, time: Tensor) -> Tensor:
        """One counted evaluation.

        Raises:
            EvaluationCapError: The cap was reached; nothing is evaluated beyond it.
        """
        self.spend()
        return self._network(chunks, time)

    def spend(self) -> None:
        """Count what costs as much as an evaluation: one, or a backward pass through one.

        Raises:
            EvaluationCapError: The cap was reached.
        """
        if self.cap is not None and not self.nfe < self.cap:
            raise EvaluationCapError(
                where="network evaluations of one sample",
                found=f"more than {self.cap}, and it is not finished",
                expected=f"at most sampler.nfe_cap, {self.cap}",
                action="Reject the chunk and hold; raise the cap or the tolerance.",
            )
        self.nfe += 1


def refuse_name(name: str, known: tuple[str, ...]) -> NoReturn:
    """Raise: a sampler of that name is not known here."""
    raise ConfigError(
        where="sampler.name",
        found=repr(name),
        expected=f"one of {', '.join(known)}",
        action="Choose a sampler that fits the method.",
    )
