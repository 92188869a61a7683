"""A function of named arrays behind the wire: draws named, evaluations counted, spans measured.

What a program of one call does cannot be told apart from outside: its time is `sample`, and where
in it the encoding ends is unknown. Only an encoder that is a program of its own is timed as one.
"""

import itertools
import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.hosts.kinds import DrawingEntry, HostedEntry
from genpolicy.candidates.hosts.ports import Port, chunk_of, wanted_inputs
from genpolicy.candidates.wire.extension import MOST_CANDIDATES, VERSION, WORD
from genpolicy.candidates.wire.served import UNNAMED, read_request
from genpolicy.contract.latency import Term
from genpolicy.errors import ContractError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.policies.protocol import NoiseName
from genpolicy.seeds import counter_noise

Array = NDArray[Any]
Given = Mapping[str, Any]


class Served(Protocol):
    """Who answers messages."""

    @property
    def metadata(self) -> dict[str, Any]:
        """What is said first."""
        ...

    def answer(self, message: dict[str, Any]) -> dict[str, Any]:
        """The answer to a message."""
        ...


class HostedPolicy:
    """Answers messages with the chunks of a function; see `genpolicy.candidates.wire.served`.

    Args:
        entry: What is declared.
        draw: A chunk of the inputs, noise among them.
        encode: What is done once for all candidates of an observation; its result replaces the
            inputs. None where nobody can tell it apart.
        evaluations: Of the network, in one chunk; None where nobody counts.
        widths: Numbers of each input, where they are known.
    """

    def __init__(
        self,
        entry: DrawingEntry,
        draw: Callable[[Given], Array],
        *,
        encode: Callable[[Given], Given] | None = None,
        evaluations: int | None = None,
        widths: Mapping[str, int],
    ) -> None:
        self._entry, self._draw, self._encode = entry, draw, encode
        self._evaluations = evaluations
        self._ports = wanted_inputs(entry, widths)
        self._checkpoint = files_sha256(entry)
        self._stream = (entry.noise.stream if entry.noise else None) or self._checkpoint
        self._unnamed = itertools.count()

    @property
    def metadata(self) -> dict[str, Any]:
        """What is said first."""
        encoding = [str(Term.ENCODE)] if self._encode else []
        return {
            "candidate": self._entry.name,
            "kind": self._entry.kind,
            "threads": self._entry.threads,
            WORD: {
                "version": VERSION,
                "checkpoint": self._checkpoint,
                "prediction_horizon": self._entry.horizons.prediction_horizon,
                "seeded": True,
                "candidates": MOST_CANDIDATES,
                "counts_evaluations": self._evaluations is not None,
                "spans": [str(Term.PREPROCESS), *encoding, str(Term.SAMPLE)],
            },
        }

    def answer(self, message: dict[str, Any]) -> dict[str, Any]:
        """Chunks of one observation.

        Raises:
            ContractError: An input that is missing or another one, an extension that is none, or
                an answer of the function that is no chunk.
        """
        asked = read_request(message.get(WORD))
        name: NoiseName = (UNNAMED, next(self._unnamed)) if asked is None else asked[1]
        number = 1 if asked is None else asked[2]
        begun = time.perf_counter()
        given: Given = {**self._inputs(message), **self._entry.constants}
        prepared = time.perf_counter()
        if self._encode is not None:
            given = self._encode(given)
        encoded = time.perf_counter()
        drawn = np.stack([self._chunk(given, name, row) for row in range(number)])
        sampled = time.perf_counter()
        key = self._entry.action.key
        if asked is None:
            return {key: drawn[0]}
        spans = {str(Term.PREPROCESS): prepared - begun, str(Term.SAMPLE): sampled - encoded}
        if self._encode is not None:
            spans[str(Term.ENCODE)] = encoded - prepared
        said: dict[str, Any] = {
            "invocation": asked[0],
            "checkpoint": self._checkpoint,
            "spans_s": spans,
        }
        if self._evaluations is not None:
            said["nfe"] = self._evaluations
        return {key: drawn, WORD: said}

    def _chunk(self, given: Given, name: NoiseName, candidate: int) -> Array:
        noise = self._entry.noise
        drawn = {}
        if noise is not None:
            names = (self._stream, *name, candidate)
            draws = [
                counter_noise((*names, step), shape=tuple(noise.shape))
                for step in range(noise.steps or 1)
            ]
            drawn[noise.input] = draws[0] if noise.steps is None else np.stack(draws)
        return chunk_of(self._draw({**given, **drawn}), self._entry, said_by=self._entry.name)

    def _inputs(self, message: Mapping[str, Any]) -> dict[str, Array]:
        found = {}
        for name, port in self._ports.items():
            value = message.get(name)
            known = isinstance(value, np.ndarray)
            own = Port(value.shape, value.dtype.name) if known else None  # type: ignore[union-attr]
            if own is None or len(own.shape) != len(port.shape) or not port.takes(own):
                raise ContractError(
                    where=f"message to {self._entry.name}: {name}",
                    found=str(own) if own else type(value).__name__,
                    expected=str(port),
                    action="See `observation` in its entry.",
                )
            found[name] = np.ascontiguousarray(value)
        return found


def files_sha256(entry: HostedEntry) -> str:
    """What is hosted, by the hashes of its files."""
    return sha256_bytes(canonical_json(dict(entry.files)))
