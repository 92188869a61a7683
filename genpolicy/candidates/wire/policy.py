"""A policy behind the wire in the place of one of ours: what it does wrong is a chunk that is none.

An invocation that ends in a fault gives chunks of NaN, which the first layer of feasibility refuses
one by one: the candidate pays for it, and whoever asked goes on.
"""

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.wire.connection import Clock
from genpolicy.candidates.wire.entry import verify_files
from genpolicy.candidates.wire.extension import Capabilities
from genpolicy.candidates.wire.faults import PolicyError
from genpolicy.candidates.wire.launched import Launched
from genpolicy.candidates.wire.remote import Invocation, RemotePolicy
from genpolicy.contract.action import ACTION_DIM
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.latency import Term
from genpolicy.contract.observation import ObservationContract
from genpolicy.errors import ConfigError
from genpolicy.policies.guidance import Prefix
from genpolicy.policies.protocol import NoiseName, Samples

Array = NDArray[np.float64]

GONE_AFTER = 8
"""Faults in a row after which it is asked no more: each may cost a whole timeout."""
OWN_TERMS = (Term.PREPROCESS, Term.ENCODE, Term.SAMPLE)
"""What happens in its process."""


class WirePolicy:
    """A brought policy that is running; see `genpolicy.policies.policy.Policy`.

    Args:
        brought: Who it is.
        remote: How it is asked.
        clock: Of this machine.

    Attributes:
        asked: Invocations so far.
        faults: How many of them ended in each kind of fault.
    """

    guided = False

    def __init__(
        self, brought: BroughtPolicy, remote: RemotePolicy, *, clock: Clock = time.perf_counter
    ) -> None:
        self._brought, self._remote, self._clock = brought, remote, clock
        self._in_a_row = 0
        self.asked = 0
        self.faults: Counter[str] = Counter()

    @property
    def method(self) -> str:
        """Its name: one method has one policy of its kind."""
        return self._brought.name

    @property
    def checkpoint_hash(self) -> str:
        """SHA-256 of what its entry says, the hashes of its files among it."""
        return self._brought.sha256

    @property
    def sampler_config_hash(self) -> str:
        """SHA-256 of what its entry says of the sampler."""
        return self._brought.sampler_sha256

    @property
    def horizons(self) -> HorizonConfig:
        """As its entry says; those of the ladder."""
        return self._brought.entry.horizons

    @property
    def prediction_horizon(self) -> int:
        """K, actions of one chunk."""
        return self.horizons.prediction_horizon

    @property
    def stochastic(self) -> bool:
        """Whether its entry says that candidates of one observation differ."""
        return self._brought.entry.stochastic

    @property
    def remote(self) -> RemotePolicy:
        """How it is asked where a fault is to be seen as what it is."""
        return self._remote

    @property
    def told(self) -> Capabilities:
        """What its server says of itself."""
        return self._remote.told

    def sample(
        self,
        observations: Array,
        *,
        noise_names: Sequence[NoiseName],
        candidates: int,
        prefix: Prefix | None = None,
    ) -> Samples:
        """Candidate chunks, one observation a message; NaN where there is no answer.

        Raises:
            ConfigError: A prefix, which no server is asked to go on from.
        """
        if prefix is not None:
            raise ConfigError(
                where=f"a prefix for {self.method}",
                found="an invocation that shall go on from given actions",
                expected="none, of a policy behind the wire",
                action="Add it to `stress.joining.exempt`, or choose another rule.",
            )
        drawn, counts = [], [0]
        for row, name in zip(observations, noise_names, strict=True):
            answer = self.invoke(row, noise=name, candidates=candidates)
            drawn.append(self._chunks(answer, candidates))
            if answer is not None and answer.evaluations is not None:
                counts.append(answer.evaluations)
        return Samples(np.stack(drawn), max(counts))

    def timed(
        self, observations: Array, *, noise: NoiseName, candidates: int
    ) -> tuple[dict[Term, float], Array]:
        """One invocation with what its terms took, s, and its chunks (N, K, D_a).

        Whatever no span of its server explains is counted as sampling: the message itself, and all
        of a server that measures nothing. A term that nobody measured is NaN: unknown, not zero.
        An invocation that ends in a fault took as long as it was waited for.
        """
        begun = self._clock()
        answer = self.invoke(observations, noise=noise, candidates=candidates)
        if answer is None:
            waited = {**dict.fromkeys(OWN_TERMS, np.nan), Term.SAMPLE: self._clock() - begun}
            return waited, self._chunks(None, candidates)
        spans = {term: answer.spans_s.get(str(term), np.nan) for term in OWN_TERMS}
        rest_s = answer.seconds - sum(answer.spans_s.get(str(term), 0.0) for term in OWN_TERMS)
        known_s = 0.0 if np.isnan(spans[Term.SAMPLE]) else spans[Term.SAMPLE]
        return {**spans, Term.SAMPLE: known_s + max(0.0, rest_s)}, self._chunks(answer, candidates)

    def invoke(
        self, observations: Array, *, noise: NoiseName, candidates: int
    ) -> Invocation | None:
        """One invocation (H_o, D_o); None if it ended in a fault, which is counted."""
        self.asked += 1
        if self._in_a_row >= GONE_AFTER:
            self.faults["gone"] += 1
            return None
        count = candidates if self.stochastic else 1
        try:
            answer = self._remote.invoke(observations, noise=noise, candidates=count)
        except PolicyError as error:
            self.faults[str(error.fault)] += 1
            self._in_a_row += 1
            return None
        self._in_a_row = 0
        return answer

    def _chunks(self, answer: Invocation | None, candidates: int) -> Array:
        """Shape (N, K, D_a); one that is always the same is there N times."""
        if answer is None:
            return np.full((candidates, self.prediction_horizon, ACTION_DIM), np.nan)
        if len(answer.actions) == candidates:
            return answer.actions
        return np.broadcast_to(answer.actions, (candidates, *answer.actions.shape[1:])).copy()


@contextmanager
def running(brought: BroughtPolicy, contract: ObservationContract) -> Iterator[WirePolicy]:
    """A brought policy, its files verified, its server started here and ended.

    Args:
        brought: Who it is.
        contract: The observation in force.

    Raises:
        IntegrityError: A file of it is another one.
        ConfigError: Its program is not there.
        ContractError: Its entry names what the observation does not have.
        PolicyError: It does not listen, or says what it can in a way that is none.
    """
    folder: Path = brought.folder
    verify_files(brought.entry, folder)
    with Launched(brought.entry, folder) as server:
        remote = RemotePolicy(brought.entry, server.address, contract, ended=server.died)
        try:
            yield WirePolicy(brought, remote)
        finally:
            remote.close()
