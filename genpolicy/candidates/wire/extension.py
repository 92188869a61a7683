"""What a server may say beyond openpi's protocol, so that its candidate can be reproduced.

The word `genpolicy` in the metadata says what it can; the same word in a message names the noise
and the number of candidates, and in an answer what was counted. A server that never heard of it is
asked plainly, one candidate a message, and what it does not say is unknown.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from genpolicy.candidates.wire.faults import Fault, PolicyError
from genpolicy.contract.latency import Term
from genpolicy.contract.settings import Settings

Array = NDArray[np.float64]

WORD = "genpolicy"
VERSION = 1
MOST_CANDIDATES = 64
MOST_EVALUATIONS = 2**31 - 1
LONGEST = 80
"""Characters of a value of the metadata that an error repeats."""
DIGEST = r"^[0-9a-f]{64}$"
NoiseName = tuple[str | int, ...]


class Capabilities(Settings):
    """What the metadata say; defaults are those of a server without the extension.

    Attributes:
        version: Of the extension; 0 without it.
        checkpoint: SHA-256 of what it serves; None where it does not say.
        sampler: SHA-256 of its sampler's settings.
        prediction_horizon: K.
        seeded: Equal names of noise give equal chunks.
        candidates: Most candidates that it draws in one message.
        counts_evaluations: It counts network evaluations at the network.
        spans: Latency terms that it measures, by their names in the contract.
        prefix: It can draw chunks that go on from given actions.
        samplers: Names of other settings of its sampler that a message may ask for.
    """

    version: int = Field(default=0, ge=0)
    checkpoint: str | None = Field(default=None, pattern=DIGEST)
    sampler: str | None = Field(default=None, pattern=DIGEST)
    prediction_horizon: int | None = Field(default=None, ge=1, le=512)
    seeded: bool = False
    candidates: int = Field(default=1, ge=1)
    counts_evaluations: bool = False
    spans: tuple[str, ...] = ()
    prefix: bool = False
    samplers: tuple[str, ...] = ()


def capabilities(metadata: dict[str, Any]) -> Capabilities:
    """What a server can, from its metadata.

    Raises:
        PolicyError: It speaks of the extension and says something else than that.
    """
    said = metadata.get(WORD)
    if said is None:
        return Capabilities()
    if not isinstance(said, dict):
        raise _misstated([], said, "a map of what it can")
    given = {
        name: tuple(value) if isinstance(value, list) else value for name, value in said.items()
    }
    try:
        told = Capabilities.model_validate(given)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        known = f"one of {', '.join(Capabilities.model_fields)}"
        rule = first["msg"].replace("tuple", "list")  # as msgpack has it
        expected = known if first["type"] == "extra_forbidden" else rule
        raise _misstated(first["loc"], first["input"], expected) from error
    if told.version != VERSION:
        raise _misstated(["version"], told.version, f"{VERSION}, the version that is known here")
    if unknown := sorted(set(told.spans) - {str(term) for term in Term}):
        raise _misstated(["spans"], unknown[0], f"latency terms: {', '.join(Term)}")
    return told


def _misstated(place: Sequence[int | str], found: object, expected: str) -> PolicyError:
    """A word of the metadata that says something else than it may, with what stands there."""
    where = ".".join([WORD, *map(str, place)])
    return PolicyError(
        Fault.MALFORMED,
        f"its metadata say {where}: {repr(found)[:LONGEST]}",
        expected,
        f"Correct `{where}` where the server writes its metadata; docs/candidates.md says what "
        "each word means.",
    )


@dataclass(frozen=True)
class Drawn:
    """One invocation's answer.

    Attributes:
        actions: Candidate chunks as the policy wrote them. Shape (N, K, D).
        evaluations: Network evaluations of a sample; None where it does not count.
        spans_s: Seconds by latency term, of the terms that it measures.
        sampler: Hash of the sampler's settings that drew them; None where it does not say.
    """

    actions: Array
    evaluations: int | None = None
    spans_s: dict[str, float] = field(default_factory=dict)
    sampler: str | None = None


@dataclass(frozen=True)
class GoesOn:
    """What the chunks of one invocation are drawn to go on from.

    Attributes:
        actions: Given actions, finite; of no consequence where the weight is 0. Shape (K, D).
        weights: From 0, free, to 1, as given; falling. Shape (K,).
        bound: Largest factor of the guidance, > 0.
    """

    actions: Array
    weights: Array
    bound: float

    @property
    def frozen(self) -> int:
        """First rows that are executed whatever is drawn: those of weight 1."""
        return int(np.cumprod(self.weights >= 1.0).sum())


def request(
    invocation: str,
    noise: NoiseName,
    candidates: int,
    prefix: GoesOn | None = None,
    sampler: str | None = None,
) -> dict[str, Any]:
    """What a message to a server with the extension says."""
    said: dict[str, Any] = {
        "invocation": invocation, "noise": list(noise), "candidates": candidates,
    }  # fmt: skip
    if sampler is not None:
        said["sampler"] = sampler
    if prefix is None:
        return {WORD: said}
    given = {
        "actions": prefix.actions, "weights": prefix.weights, "frozen": prefix.frozen,
        "bound": prefix.bound,
    }  # fmt: skip
    return {WORD: {**said, "prefix": given}}


def read_answer(
    answer: dict[str, Any],
    *,
    key: str,
    told: Capabilities,
    invocation: str,
    candidates: int,
    sampler: str | None = None,
    settings: str | None = None,
) -> Drawn:
    """The chunks of an answer.

    Args:
        answer: As it came.
        key: Name of the actions in it.
        told: What the server said of itself at first.
        invocation: What was asked.
        candidates: How many chunks were asked for.
        sampler: Which other setting was asked for; its hash is not that of the metadata.
        settings: That hash, as it was answered first; None before.

    Raises:
        PolicyError: Another invocation's, another checkpoint's, or no actions of that number.
    """
    said: dict[str, Any] = {}
    if told.version:
        said = answer.get(WORD)  # type: ignore[assignment]
        if not isinstance(said, dict):
            raise PolicyError(Fault.MALFORMED, f"an answer without {WORD!r}")
        named = said.get("invocation")
        if not isinstance(named, str) or named != invocation:
            found = f"an answer to {str(named)[:40]!r}, asked was {invocation!r}"
            raise PolicyError(Fault.UNREQUESTED, found)
        for name in ("checkpoint", *(["sampler"] if sampler is None else [])):
            before, now = getattr(told, name), said.get(name)
            if before is not None and not (isinstance(now, str) and now == before):
                raise PolicyError(
                    Fault.CHANGED, f"its {name} was {before[:16]}…, and is {str(now)[:16]}…"
                )
    own = said.get("sampler")
    another = isinstance(own, str) and own != told.sampler and own == (settings or own)
    if told.sampler is not None and sampler is not None and not another:
        raise PolicyError(
            Fault.CHANGED, f"the setting {sampler!r} is answered under {str(own)[:16]}…"
        )
    return Drawn(
        _actions(answer.get(key), key, told, candidates),
        _count(said.get("nfe")) if told.counts_evaluations else None,
        {term: _seconds(said.get("spans_s"), term) for term in told.spans},
        own if isinstance(own, str) else None,
    )


def _actions(found: Any, key: str, told: Capabilities, candidates: int) -> Array:
    if not isinstance(found, np.ndarray) or found.dtype.kind not in "fiu":
        raise PolicyError(Fault.SHAPE, f"no array {key!r} in the answer")
    chunks = found[None] if not told.version and found.ndim == 2 else found
    if chunks.ndim != 3 or len(chunks) != candidates or 0 in chunks.shape:
        expected = f"{candidates} x K x D" if told.version else "K x D"
        shape = " x ".join(str(size) for size in found.shape)
        raise PolicyError(Fault.SHAPE, f"{key!r} of shape {shape or '()'}, not {expected}")
    return chunks.astype(np.float64)


def _count(found: Any) -> int:
    if type(found) is not int or not 1 <= found <= MOST_EVALUATIONS:
        raise PolicyError(Fault.MALFORMED, f"{found!r} network evaluations"[:80])
    return found


def _seconds(found: Any, term: str) -> float:
    value = found.get(term) if isinstance(found, dict) else None
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0.0 <= value < 3600.0:
        raise PolicyError(Fault.MALFORMED, f"{value!r} seconds of {term}, which it measures")
    return float(value)
