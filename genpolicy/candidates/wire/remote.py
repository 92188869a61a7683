"""A policy behind the wire, asked as one of ours would be; whatever it does is its own fault."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.wire.connection import Clock, Connection, dial
from genpolicy.candidates.wire.entry import ServerEntry
from genpolicy.candidates.wire.extension import (
    Capabilities,
    Drawn,
    GoesOn,
    NoiseName,
    capabilities,
    read_answer,
    request,
)
from genpolicy.candidates.wire.faults import Fault, PolicyError
from genpolicy.candidates.wire.mapping import Inputs, Outputs
from genpolicy.candidates.wire.writing import not_writable
from genpolicy.contract.observation import ObservationContract

Array = NDArray[np.float64]
FURTHER = "further"
"""Behind the noise's name, with the number of the first chunk, of all messages but the first."""


@dataclass(frozen=True)
class Invocation:
    """What became of one invocation.

    Attributes:
        actions: Candidate chunks in mapped actions, finite or not. Shape (N, K, 10).
        evaluations: Network evaluations of a sample; None where the server does not count.
        spans_s: Seconds by latency term, of the terms that it measures.
        seconds: From the first byte sent to the last chunk mapped, by the clock of this machine.
        messages: In how many messages it was asked.
    """

    actions: Array
    evaluations: int | None
    spans_s: dict[str, float]
    seconds: float
    messages: int


class RemotePolicy:
    """A policy that answers over the wire.

    A line on which something went wrong is dropped, because a late answer on it would look like
    the next one; the next invocation dials again.

    Args:
        entry: What it is.
        address: Where it listens.
        contract: The observation in force.
        clock: Of this machine.
        scene: The MJCF that describes the robot; None where nobody knows it.
        ended: Why its process is not there any more, where we started it; None while it is.

    Raises:
        ContractError: The entry names what the observation or the robot does not have.
        PolicyError: Nobody listens, or says what it can in a way that is none.
    """

    def __init__(
        self, entry: ServerEntry, address: str, contract: ObservationContract, *,
        scene: Path | None = None,
        clock: Clock = time.perf_counter, ended: Callable[[], str | None] = lambda: None,
    ) -> None:  # fmt: skip
        self.entry = entry
        self._clock = clock
        self._ended = ended
        self._address = address
        self._inputs = Inputs(
            entry.observation, contract,
            observation_horizon=entry.horizons.observation_horizon,
        )  # fmt: skip
        self._outputs = Outputs(entry.action, contract, scene=scene)
        self._asked = 0
        self._settings: dict[str | None, str] = {}  # hash by setting, as first answered
        self._line: Connection | None = None
        try:
            self.told: Capabilities = capabilities(self._connected().metadata)
        except PolicyError as error:
            self.close()
            if gone := ended():
                raise PolicyError(Fault.CLOSED, gone) from error
            raise
        if self.told.prediction_horizon not in (None, entry.horizons.prediction_horizon):
            self.close()
            raise PolicyError(
                Fault.SHAPE,
                f"it predicts {self.told.prediction_horizon} actions, its entry says "
                f"{entry.horizons.prediction_horizon}",
            )

    @property
    def unguided(self) -> str:
        """Why its chunks cannot be drawn to go on from given actions; empty where they can."""
        if not self.told.prefix:
            return "a server that takes no prefix"
        return not_writable(self.entry.action)

    def invoke(
        self, observations: Array, *, noise: NoiseName, candidates: int,
        prefix: GoesOn | None = None, sampler: str | None = None,
    ) -> Invocation:  # fmt: skip
        """Candidate chunks of one observation.

        Args:
            observations: Physical units, newest last. Shape (H_o, D_o).
            noise: Name of the noise; a server that cannot be seeded never sees it.
            candidates: N >= 1. Asked for one by one where the server draws no more at once.
            prefix: Mapped actions that the chunks go on from, of one that takes a prefix.
            sampler: Another setting than the judged one, by its name.

        Raises:
            ContractError: A prefix in whose form the entry says no actions.
            PolicyError: It did not answer, or not with what was declared; there is no chunk.
        """
        begun = self._clock()
        at_once = min(candidates, self.told.candidates) if self.told.version else 1
        given = None
        if prefix is not None:
            own = self._outputs.written(prefix.actions, observations[-1])
            given = replace(prefix, actions=own)
        drawn: list[Drawn] = []
        for first in range(0, candidates, at_once):
            number = min(at_once, candidates - first)
            # All that is drawn at once has the name as it is, as of a policy that is asked here.
            name = (*noise, FURTHER, first) if first else noise
            drawn.append(self._draw(observations, name, number, given, sampler))
        chunks = np.concatenate([part.actions for part in drawn])
        mapped = self._outputs.mapped(chunks, observations[-1])
        counts = [part.evaluations for part in drawn if part.evaluations is not None]
        return Invocation(
            mapped,
            max(counts) if counts else None,
            {term: sum(part.spans_s[term] for part in drawn) for term in self.told.spans},
            self._clock() - begun,
            len(drawn),
        )

    def round_trip_s(self) -> float | None:
        """How long the wire itself takes, s; None where the server answers no ping.

        Raises:
            PolicyError: Nobody listens.
        """
        return self._connected().round_trip_s(timeout_s=self.entry.timeout_s, clock=self._clock)

    def close(self) -> None:
        """Hang up."""
        if self._line is not None:
            self._line.close()
            self._line = None

    def _draw(
        self,
        observations: Array,
        noise: NoiseName,
        candidates: int,
        prefix: GoesOn | None,
        sampler: str | None,
    ) -> Drawn:
        if sampler is not None and sampler not in self.told.samplers:
            raise PolicyError(Fault.REFUSED, f"its metadata offer no sampler {sampler!r}")
        invocation = str(self._asked)
        self._asked += 1
        message = {**self._inputs.of(observations), **self.entry.constants}
        if self.told.version:
            message |= request(invocation, noise, candidates, prefix, sampler)
        try:
            answer = self._connected().ask(message, timeout_s=self.entry.timeout_s)
            drawn = read_answer(
                answer, key=self.entry.action.key, told=self.told, invocation=invocation,
                candidates=candidates, sampler=sampler, settings=self._settings.get(sampler),
            )  # fmt: skip
            self._check_shape(drawn)
            if drawn.sampler is not None:
                self._settings.setdefault(sampler, drawn.sampler)
        except PolicyError as error:
            self.close()
            if ended := self._ended():
                raise PolicyError(Fault.CLOSED, ended) from error
            raise
        return drawn

    def _check_shape(self, drawn: Drawn) -> None:
        """As many actions as the entry says, and every column that it gives a meaning to."""
        rows, columns = drawn.actions.shape[1:]
        expected, width = self.entry.horizons.prediction_horizon, self.entry.action.width
        if rows != expected or columns < width:
            raise PolicyError(
                Fault.SHAPE,
                f"chunks of {rows} actions of {columns} numbers; its entry says {expected} actions "
                f"and names column {width - 1}",
            )

    def _connected(self) -> Connection:
        if self._line is None:
            line = dial(
                self._address, allowed=self.entry.allow_host, timeout_s=self.entry.timeout_s
            )
            try:
                self._require_same(line)
            except PolicyError:
                line.close()  # nobody else holds this line
                raise
            self._line = line
        return self._line

    def _require_same(self, line: Connection) -> None:
        """Hold it against what it said when it was first dialled; then there is nothing to hold."""
        told = getattr(self, "told", None)
        if told is not None and capabilities(line.metadata) != told:
            raise PolicyError(Fault.CHANGED, "its metadata are others than at first")
