"""Perturbation schedules: what is injected at which invocation, the same for every method.

A schedule is a pure function of root seed, perturbation, start and invocation. It never sees
the method, so two methods on the same start meet the same world. One class a kind, with the
fields that this kind has and no other.
"""

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import Field

from genpolicy.contract.settings import Settings
from genpolicy.seeds import stream


@dataclass(frozen=True)
class Injection:
    """What one invocation suffers.

    Attributes:
        extra_s: Added duration by latency term, s.
        compute_factor: Slow-down of measured terms.
        dropped: The chunk is lost on the way.
    """

    extra_s: dict[str, float] = field(default_factory=dict)
    compute_factor: float = 1.0
    dropped: bool = False


class InvocationPerturbation(Settings):
    """What hits some invocations.

    Attributes:
        probability: Share of invocations that it hits.
    """

    probability: float = Field(default=1.0, ge=0.0, le=1.0)

    @abstractmethod
    def hit(self, lot: float) -> Injection:
        """What an invocation suffers that it hits.

        Args:
            lot: Uniform in [0, 1), for a size that varies.
        """


class CameraDelay(InvocationPerturbation):
    """The picture comes later; `magnitude_s` is added to the capture, s."""

    kind: Literal["camera_delay"] = "camera_delay"
    magnitude_s: float = Field(ge=0.0)

    def hit(self, lot: float) -> Injection:
        """Always the whole delay."""
        return Injection(extra_s={"capture": self.magnitude_s})


class ComputeContention(InvocationPerturbation):
    """Another load on the machine; measured terms take `factor` times as long."""

    kind: Literal["compute_contention"] = "compute_contention"
    factor: float = Field(ge=1.0)

    def hit(self, lot: float) -> Injection:
        """Always the whole factor."""
        return Injection(compute_factor=self.factor)


class NetworkJitter(InvocationPerturbation):
    """The network takes longer, by up to `magnitude_s`, s, uniformly."""

    kind: Literal["network_jitter"] = "network_jitter"
    magnitude_s: float = Field(ge=0.0)

    def hit(self, lot: float) -> Injection:
        """A share of the magnitude."""
        return Injection(extra_s={"network": lot * self.magnitude_s})


class QueueReorder(InvocationPerturbation):
    """A chunk waits `magnitude_s`, s, so that a later one may overtake it."""

    kind: Literal["queue_reorder"] = "queue_reorder"
    magnitude_s: float = Field(ge=0.0)

    def hit(self, lot: float) -> Injection:
        """Always the whole wait."""
        return Injection(extra_s={"queue": self.magnitude_s})


class ChunkDrop(InvocationPerturbation):
    """A chunk is lost on the way."""

    kind: Literal["chunk_drop"] = "chunk_drop"

    def hit(self, lot: float) -> Injection:
        """The chunk is lost."""
        return Injection(dropped=True)


class Nominal(Settings):
    """Nothing is injected."""

    kind: Literal["nominal"] = "nominal"


class SidewaysPush(Settings):
    """The hand is pushed sideways once per rollout, with `force_n`, N."""

    kind: Literal["push"] = "push"
    force_n: float = Field(gt=0.0)


Perturbation = Annotated[
    Nominal
    | CameraDelay
    | ComputeContention
    | NetworkJitter
    | QueueReorder
    | ChunkDrop
    | SidewaysPush,
    Field(discriminator="kind"),
]


def injection(
    perturbation: Perturbation, *, root_seed: int, name: str, start: int, invocation: int
) -> Injection:
    """What the perturbation `name` does to an invocation; nothing, if its lot does not fall."""
    if not isinstance(perturbation, InvocationPerturbation):
        return Injection()
    generator = stream(root_seed, "perturbation", name, start, invocation)
    falls = float(generator.random()) < perturbation.probability
    lot = float(generator.random())
    return perturbation.hit(lot) if falls else Injection()


@dataclass(frozen=True)
class Push:
    """One sideways push on the hand.

    Attributes:
        time_s: When it begins, s after the start.
        force_n: Sideways force, N, signed.
        duration_s: How long, s.
    """

    time_s: float
    force_n: float
    duration_s: float


def push(perturbation: Perturbation, *, root_seed: int, name: str, start: int) -> Push | None:
    """The push of this start, or none where the perturbation pushes nobody."""
    if not isinstance(perturbation, SidewaysPush):
        return None
    generator = stream(root_seed, "push", name, start)
    sign = 1.0 if generator.random() < 0.5 else -1.0
    return Push(
        time_s=float(generator.uniform(0.3, 1.5)),
        force_n=sign * perturbation.force_n,
        duration_s=0.2,
    )
