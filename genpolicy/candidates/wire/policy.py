"""A policy behind the wire in the place of one of ours: what it does wrong ends that invocation.

An invocation that ends in a fault has a kind and no chunk; whoever wants numbers of all rows gets
NaN in its place, which the first layer of feasibility refuses. The candidate pays for it, and
whoever asked goes on. So it is with a server that does not even start.
"""

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.hosts.translation import as_server
from genpolicy.candidates.wire.connection import Clock
from genpolicy.candidates.wire.entry import verify_files
from genpolicy.candidates.wire.extension import Capabilities, GoesOn
from genpolicy.candidates.wire.faults import Fault, PolicyError
from genpolicy.candidates.wire.launched import Launched
from genpolicy.candidates.wire.remote import Invocation, RemotePolicy
from genpolicy.candidates.wire.spans import terms_of
from genpolicy.contract.action import ACTION_DIM
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.latency import Term
from genpolicy.contract.observation import ObservationContract
from genpolicy.errors import ConfigError
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.protocol import NoiseName, Samples

Array = NDArray[np.float64]

GONE_AFTER = 8
"""Faults in a row after which it is asked no more: each may cost a whole timeout."""
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""By which a process is told how many threads its arithmetic has."""


@dataclass(frozen=True)
class WireSamples(Samples):
    """Chunks of which some rows may be none.

    Attributes:
        faults: Of each row: how its invocation failed; None where it was answered.
    """

    faults: tuple[Fault | None, ...]


class WirePolicy:
    """A brought policy that is asked; see `genpolicy.policies.policy.Policy`.

    Args:
        brought: Who it is.
        remote: How it is asked; or why it cannot be: then every invocation ends in that fault.
        clock: Of this machine.
        sampler: Another setting that it is asked for, by its name in the entry; None: the judged.

    Attributes:
        asked: Invocations so far.
        faults: How many of them ended in each kind of fault.
        last_words: What was seen at the last fault that had a cause; empty without any.
    """

    def __init__(
        self, brought: BroughtPolicy, remote: RemotePolicy | PolicyError, *,
        clock: Clock = time.perf_counter, sampler: str | None = None,
    ) -> None:  # fmt: skip
        self._sampler = sampler
        self._brought, self._remote, self._clock = brought, remote, clock
        self._in_a_row = 0
        self.asked = 0
        self.faults: Counter[Fault] = Counter()
        self.last_words = ""

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
        return self._brought.sampler_sha256_of(self._sampler)

    def sampling_by(self, sampler: str) -> "WirePolicy":
        """The same server, asked for another setting; faults there are no faults of this one."""
        return WirePolicy(self._brought, self._remote, clock=self._clock, sampler=sampler)

    @property
    def samplers(self) -> list[str]:
        """Other settings that its entry names, in order."""
        return sorted(self._brought.entry.samplers)

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
    def absent(self) -> bool:
        """Whether its server did not start."""
        return isinstance(self._remote, PolicyError)

    @property
    def guided(self) -> bool:
        """Whether its server takes a prefix, and its entry says actions in which one is written."""
        return isinstance(self._remote, RemotePolicy) and not self._remote.unguided

    @property
    def remote(self) -> RemotePolicy | PolicyError:
        """How it is asked where a fault is to be seen as what it is; or why it did not start."""
        return self._remote

    @property
    def told(self) -> Capabilities:
        """What its server says of itself; nothing, of one that is not there."""
        return Capabilities() if isinstance(self._remote, PolicyError) else self._remote.told

    def sample(
        self,
        observations: Array,
        *,
        noise_names: Sequence[NoiseName],
        candidates: int,
        prefix: Prefix | None = None,
    ) -> WireSamples:
        """Candidate chunks, one observation a message; NaN where there is no answer.

        Raises:
            ConfigError: A prefix, of one whose chunks cannot be drawn to go on from it.
        """
        drawn, faults, counts = [], [], [0]
        for number, (row, name) in enumerate(zip(observations, noise_names, strict=True)):
            given = self._given(prefix, number)
            answer = self.invoke(row, noise=name, candidates=candidates, prefix=given)
            drawn.append(self._chunks(answer, candidates))
            faults.append(answer if isinstance(answer, Fault) else None)
            if isinstance(answer, Invocation) and answer.evaluations is not None:
                counts.append(answer.evaluations)
        return WireSamples(np.stack(drawn), max(counts), tuple(faults))

    def timed(
        self, observations: Array, *, noise: NoiseName, candidates: int,
        prefix: Prefix | None = None,
    ) -> tuple[dict[Term, float], Array]:  # fmt: skip
        """One invocation with what its terms took, s, and its chunks (N, K, D_a).

        Whatever no span of the model explains is counted as sampling: the message itself, and all
        of a server that measures nothing (`wire.spans`). A term that nobody measured is NaN:
        unknown, not zero. An invocation that ends in a fault took as long as it was waited for.
        """
        begun = self._clock()
        given = self._given(prefix, 0)
        answer = self.invoke(observations, noise=noise, candidates=candidates, prefix=given)
        if isinstance(answer, Fault):
            return terms_of({}, self._clock() - begun), self._chunks(answer, candidates)
        return terms_of(answer.spans_s, answer.seconds), self._chunks(answer, candidates)

    def invoke(
        self, observations: Array, *, noise: NoiseName, candidates: int,
        prefix: GoesOn | None = None,
    ) -> Invocation | Fault:  # fmt: skip
        """One invocation (H_o, D_o), or the fault in which it ended, which is counted."""
        self.asked += 1
        if self._in_a_row >= GONE_AFTER:
            self.faults[Fault.GONE] += 1
            return Fault.GONE
        count = candidates if self.stochastic else 1
        try:
            if isinstance(self._remote, PolicyError):
                raise self._remote
            answer = self._remote.invoke(
                observations, noise=noise, candidates=count, prefix=prefix, sampler=self._sampler
            )
        except PolicyError as error:
            self._in_a_row += 1
            return self._counted(error)
        self._in_a_row = 0  # whatever it says, it costs no timeout
        if not np.isfinite(answer.actions).all(axis=(1, 2)).any():
            return self._counted(PolicyError(Fault.NONFINITE, "no chunk of finite numbers"))
        return answer

    def _given(self, prefix: Prefix | None, row: int) -> GoesOn | None:
        """What a row goes on from; None of one without a weight, which is asked plainly.

        Behind the last weight the last given action stands, which is a pose in every form.
        """
        if prefix is None or self.absent:
            return None
        assert isinstance(self._remote, RemotePolicy)  # it is not absent
        no_start = "" if prefix.strength is None else "a message that says nothing to start from"
        if why := no_start or self._remote.unguided:
            raise ConfigError(
                where=f"a prefix for {self.method}",
                found=why,
                expected="a policy whose chunks can be drawn to go on from given actions",
                action="Add it to `stress.joining.exempt`, or choose another rule.",
            )
        weights = prefix.weights[row]
        known = np.flatnonzero(weights > 0.0)
        if len(known) == 0:
            return None
        rows = np.minimum(np.arange(len(weights)), known[-1])
        return GoesOn(prefix.actions[row][rows], weights, prefix.bound)

    def _counted(self, error: PolicyError) -> Fault:
        self.faults[error.fault] += 1
        self.last_words = error.seen
        return error.fault

    def _chunks(self, answer: Invocation | Fault, candidates: int) -> Array:
        """Shape (N, K, D_a); one that is always the same is there N times."""
        if isinstance(answer, Fault):
            return np.full((candidates, self.prediction_horizon, ACTION_DIM), np.nan)
        if len(answer.actions) == candidates:
            return answer.actions
        return np.broadcast_to(answer.actions, (candidates, *answer.actions.shape[1:])).copy()


@contextmanager
def running(
    brought: BroughtPolicy, contract: ObservationContract, *, scene: Path | None = None,
    threads: int | None = None,
) -> Iterator[WirePolicy]:  # fmt: skip
    """A brought policy, its files verified, its server started here and ended.

    One that does not start, or says what it can in a way that is none, is a policy all of whose
    invocations fail: that costs this candidate, and no other.

    Args:
        brought: Who it is.
        contract: The observation in force.
        scene: The MJCF that describes the robot; None where nobody knows it.
        threads: What its process is told to use, in place of what it is declared with; a program
            obeys, a server may not. None leaves it as it is.

    Raises:
        IntegrityError: A file of it is another one.
        ConfigError: Its program is not there.
        ContractError: Its entry names what the observation or the robot does not have.
    """
    folder: Path = brought.folder
    verify_files(brought.entry, folder)
    entry = as_server(brought.entry, brought.path, contract, threads=threads)
    told = {} if threads is None else dict.fromkeys(THREAD_VARIABLES, str(threads))
    with ExitStack() as stack:
        remote: RemotePolicy | PolicyError
        try:
            server = stack.enter_context(Launched(entry, folder, environment=told))
            remote = RemotePolicy(entry, server.address, contract, scene=scene, ended=server.died)
            stack.callback(remote.close)
        except PolicyError as fault:
            remote = fault
        yield WirePolicy(brought, remote)
