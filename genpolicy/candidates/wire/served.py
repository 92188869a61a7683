"""One of our checkpoints behind the wire, for anybody's client."""

import itertools
import math
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.wire.extension import MOST_CANDIDATES, VERSION, WORD
from genpolicy.contract.action import ACTION_DIM
from genpolicy.contract.latency import Term
from genpolicy.errors import ContractError
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.protocol import NoiseName

if TYPE_CHECKING:
    from genpolicy.policies.policy import NetworkPolicy

OBSERVATION = "observation"
ACTIONS = "actions"
UNNAMED = "unnamed"
LONGEST_NAME = 64


class ServedPolicy:
    """Answers messages with a checkpoint's chunks.

    A message holds `observation`, the vectors of the observation contract, newest last, of shape
    (H_o, D_o); an answer `actions`: (K, D_a), or (N, K, D_a) for who speaks the extension. Who
    names no noise gets the next of a fixed sequence, the same after each start.

    Args:
        policy: The verified checkpoint with its sampler.
        samplers: The same weights under other samplers, by the names that a message may ask for.
    """

    def __init__(
        self, policy: "NetworkPolicy", *, samplers: "Mapping[str, NetworkPolicy] | None" = None
    ) -> None:
        self._policy, self._samplers = policy, dict(samplers or {})
        self._unnamed = itertools.count()

    @property
    def metadata(self) -> dict[str, Any]:
        """What is said first."""
        return {
            "method": self._policy.method,
            WORD: {
                "version": VERSION,
                "checkpoint": self._policy.checkpoint_hash,
                "sampler": self._policy.sampler_config_hash,
                "prediction_horizon": self._policy.prediction_horizon,
                "seeded": True,
                "candidates": MOST_CANDIDATES,
                "counts_evaluations": True,
                "spans": [str(Term.PREPROCESS), str(Term.ENCODE), str(Term.SAMPLE)],
                "prefix": self._policy.guided,
                **({"samplers": sorted(self._samplers)} if self._samplers else {}),
            },
        }

    def answer(self, message: dict[str, Any]) -> dict[str, Any]:
        """Chunks of one observation.

        Raises:
            ContractError: No observation of the checkpoint's shape, or an extension that is none.
            NonFiniteError: An observation is NaN or infinite.
        """
        asked = read_request(message.get(WORD))
        name: NoiseName = (UNNAMED, next(self._unnamed)) if asked is None else asked[1]
        number = 1 if asked is None else asked[2]
        prefix = self._prefix((message.get(WORD) or {}).get("prefix"))
        begun = time.perf_counter()
        prepared = self._policy.preprocess(_observation(message.get(OBSERVATION))[None])
        preprocessed = time.perf_counter()
        condition = self._policy.encode(prepared)
        encoded = time.perf_counter()
        policy = self._chosen((message.get(WORD) or {}).get("sampler"))
        drawn = policy.sample_encoded(
            condition, noise_names=[name], candidates=number, prefix=prefix
        )
        sampled = time.perf_counter()
        if asked is None:
            return {ACTIONS: drawn.actions[0, 0]}
        return {
            ACTIONS: drawn.actions[0],
            WORD: {
                "invocation": asked[0],
                "checkpoint": self._policy.checkpoint_hash,
                "sampler": policy.sampler_config_hash,
                "nfe": drawn.nfe,
                "spans_s": {
                    str(Term.PREPROCESS): preprocessed - begun,
                    str(Term.ENCODE): encoded - preprocessed,
                    str(Term.SAMPLE): sampled - encoded,
                },
            },
        }

    def _chosen(self, name: Any) -> "NetworkPolicy":
        """The policy under the sampler that a message asks for."""
        if name is None:
            return self._policy
        if not isinstance(name, str) or name not in self._samplers:
            known = ", ".join(sorted(self._samplers)) or "none"
            _refuse(f"{WORD}.sampler", repr(name)[:80], f"one of {known}")
        return self._samplers[name]

    def _prefix(self, found: Any) -> Prefix | None:
        """What the chunks go on from, in the actions of the checkpoint, which are the mapped."""
        if found is None:
            return None
        where = f"{WORD}.prefix"
        if not self._policy.guided:
            _refuse(where, "given actions", "none: its sampler has no path to guide")
        names = {"actions", "weights", "frozen", "bound"}
        if not isinstance(found, dict) or set(found) != names:
            _refuse(where, repr(found)[:80], ", ".join(sorted(names)))
        rows = self._policy.prediction_horizon
        actions = _finite(found["actions"], (rows, ACTION_DIM), f"{where}.actions")
        weights = _finite(found["weights"], (rows,), f"{where}.weights")
        if not ((weights >= 0.0) & (weights <= 1.0)).all():
            _refuse(f"{where}.weights", "a weight outside", "weights from 0 to 1")
        bound = found["bound"]
        if not isinstance(bound, float) or not 0.0 < bound < math.inf:
            _refuse(f"{where}.bound", repr(bound)[:80], "a number above 0")
        return Prefix(actions[None], weights[None], bound)


def _finite(found: Any, shape: tuple[int, ...], where: str) -> NDArray[np.float64]:
    known = isinstance(found, np.ndarray) and found.dtype.kind == "f" and found.shape == shape
    if not known or not np.isfinite(found).all():
        _refuse(where, type(found).__name__, f"finite numbers of shape {shape}")
    values: NDArray[np.float64] = found.astype(np.float64)
    return values


def _observation(found: Any) -> NDArray[np.float64]:
    if not isinstance(found, np.ndarray) or found.ndim not in (1, 2):
        shape = f" of shape {found.shape}" if isinstance(found, np.ndarray) else ""
        _refuse(OBSERVATION, f"{type(found).__name__}{shape}", "an array (H_o, D_o), newest last")
    values: NDArray[np.float64] = np.atleast_2d(found.astype(np.float64))  # a history of one
    return values


def read_request(found: Any) -> tuple[str, NoiseName, int] | None:
    """Invocation, name of the noise, and number of candidates; None of a plain message.

    Raises:
        ContractError: An extension that is none.
    """
    if found is None:
        return None
    names = {"invocation", "noise", "candidates"}
    if not isinstance(found, dict) or set(found) - {"prefix", "sampler"} != names:
        _refuse(
            WORD, repr(found)[:80], "invocation, noise and candidates; prefix and sampler besides"
        )
    invocation, noise, number = found["invocation"], found["noise"], found["candidates"]
    if not isinstance(invocation, str) or len(invocation) > LONGEST_NAME:
        _refuse(f"{WORD}.invocation", repr(invocation)[:80], f"up to {LONGEST_NAME} signs")
    named = isinstance(noise, list) and all(type(part) in (str, int) for part in noise)
    if not named or len(noise) > LONGEST_NAME:
        _refuse(f"{WORD}.noise", repr(noise)[:80], "a list of texts and integers")
    if type(number) is not int or not 1 <= number <= MOST_CANDIDATES:
        _refuse(f"{WORD}.candidates", repr(number)[:80], f"1 to {MOST_CANDIDATES}")
    return invocation, tuple(noise), number


def _refuse(where: str, found: str, expected: str) -> NoReturn:
    raise ContractError(
        where=f"message to the served policy: {where}",
        found=found,
        expected=expected,
        action="See docs/candidates.md.",
    )
