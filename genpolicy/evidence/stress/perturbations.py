"""Perturbation schedules: what is injected when, the same for every method.

A schedule is a pure function of root seed, perturbation, start, and exposure or invocation. It
never sees the method, so two methods on the same start meet the same world. One class a kind, with
the fields that this kind has and no other.
"""

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

from pydantic import Field, field_validator

from genpolicy.contract.settings import Settings
from genpolicy.seeds import stream

OPEN_PUSH_S = (0.3, 1.5)
"""Window of a push in the open, s after the start."""
CONTACT_PUSH_S = (0.8, 1.8)
"""Window of a push in contact, s after the first tick in a phase of contact: first it lowers."""
PUSH_DURATION_S = 0.2
DRILL_S = (0.5, 3.0)
"""Window of a drill, s after the start: from the open into contact."""


@dataclass(frozen=True)
class Injection:
    """What one exposure or one invocation suffers.

    Attributes:
        extra_s: Added duration by latency term, s.
        compute_factor: Slow-down of measured terms.
        dropped: The observation, or the chunk, is lost on the way.
    """

    extra_s: dict[str, float] = field(default_factory=dict)
    compute_factor: float = 1.0
    dropped: bool = False


class ByLot(Settings):
    """What hits some, and not others.

    Attributes:
        probability: Share that it hits. None, and no size of nothing, is refused: a condition in
            which nothing happens would pass as one that was met.
        graded: Fields whose sizes, down to a neutral one, lead from nominal to this condition.
    """

    graded: ClassVar[tuple[str, ...]] = ("probability",)

    probability: float = Field(default=1.0, gt=0.0, le=1.0)

    @abstractmethod
    def hit(self, lot: float) -> Injection:
        """What one suffers that it hits.

        Args:
            lot: Uniform in [0, 1), for a size that varies.
        """


class ExposurePerturbation(ByLot):
    """What hits some exposures: an observation comes late or never."""


class InvocationPerturbation(ByLot):
    """What hits some invocations."""


class CameraDelay(ExposurePerturbation):
    """Pictures come later; `magnitude_s` is added to the capture, s. What is seen is older."""

    kind: Literal["camera_delay"] = "camera_delay"
    magnitude_s: float = Field(gt=0.0)
    graded: ClassVar[tuple[str, ...]] = ("magnitude_s", "probability")

    def hit(self, lot: float) -> Injection:
        """Always the whole delay."""
        return Injection(extra_s={"capture": self.magnitude_s})


class FrameDrop(ExposurePerturbation):
    """A picture is lost; the next invocation waits for a later one.

    Attributes:
        probability: Share that is lost; stated, and never all: without any picture no invocation
            begins, and there is nothing to look at.
    """

    kind: Literal["frame_drop"] = "frame_drop"
    probability: float = Field(gt=0.0, lt=1.0)

    def hit(self, lot: float) -> Injection:
        """The picture is lost."""
        return Injection(dropped=True)


class PolicyStall(InvocationPerturbation):
    """The policy hangs for `magnitude_s`, s, and then goes on sampling."""

    kind: Literal["policy_stall"] = "policy_stall"
    magnitude_s: float = Field(gt=0.0)
    graded: ClassVar[tuple[str, ...]] = ("magnitude_s", "probability")

    def hit(self, lot: float) -> Injection:
        """Always the whole time."""
        return Injection(extra_s={"sample": self.magnitude_s})


class ComputeContention(InvocationPerturbation):
    """Another load on the machine; measured terms take `factor` times as long."""

    kind: Literal["compute_contention"] = "compute_contention"
    factor: float = Field(gt=1.0)
    graded: ClassVar[tuple[str, ...]] = ("factor", "probability")

    def hit(self, lot: float) -> Injection:
        """Always the whole factor."""
        return Injection(compute_factor=self.factor)


class NetworkJitter(InvocationPerturbation):
    """The network takes longer, by up to `magnitude_s`, s, uniformly."""

    kind: Literal["network_jitter"] = "network_jitter"
    magnitude_s: float = Field(gt=0.0)
    graded: ClassVar[tuple[str, ...]] = ("magnitude_s", "probability")

    def hit(self, lot: float) -> Injection:
        """A share of the magnitude."""
        return Injection(extra_s={"network": lot * self.magnitude_s})


class QueueReorder(InvocationPerturbation):
    """A chunk waits `magnitude_s`, s, so that a later one may overtake it."""

    kind: Literal["queue_reorder"] = "queue_reorder"
    magnitude_s: float = Field(gt=0.0)
    graded: ClassVar[tuple[str, ...]] = ("magnitude_s", "probability")

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
    """The hand is pushed sideways: once in the open, once more where contact begins.

    Without the second push a policy that inserts cleanly never touches anything, and nobody knows
    how hard it would. In contact the push must move the hand through the play, so it is harder.

    Attributes:
        force_n: Push in the open, N.
        contact_force_n: Push in contact, N; 0 for none.
    """

    kind: Literal["push"] = "push"
    force_n: float = Field(gt=0.0)
    contact_force_n: float = Field(default=0.0, ge=0.0)


class RecoveryDrill(Settings):
    """Recovery is called for once per rollout, whatever the policy does, at a drawn time."""

    kind: Literal["recovery_drill"] = "recovery_drill"


class ReducedEnvelope(Settings):
    """Nothing is injected; all methods are held to the workspace and speed of the trial card.

    Attributes:
        workspace_lower_m: Lower corner of the reduced workspace, base frame. Shape (3,).
        workspace_upper_m: Upper corner. Shape (3,).
        speed_limit_m_s: Most for the TCP's speed.
    """

    kind: Literal["envelope"] = "envelope"
    workspace_lower_m: tuple[float, float, float]
    workspace_upper_m: tuple[float, float, float]
    speed_limit_m_s: float = Field(gt=0.0)

    @field_validator("workspace_lower_m", "workspace_upper_m", mode="before")
    @classmethod
    def _corner(cls, value: object) -> object:
        return tuple(value) if isinstance(value, list) else value


Perturbation = Annotated[
    Nominal
    | CameraDelay
    | FrameDrop
    | PolicyStall
    | ComputeContention
    | NetworkJitter
    | QueueReorder
    | ChunkDrop
    | SidewaysPush
    | RecoveryDrill
    | ReducedEnvelope,
    Field(discriminator="kind"),
]


def gradable(perturbation: Perturbation | None) -> tuple[str, ...]:
    """Fields of a condition that a curve may be drawn over: at a neutral size it is nominal.

    A push in the open is one only where none in contact stays when it is gone.
    """
    if isinstance(perturbation, SidewaysPush) and perturbation.contact_force_n == 0.0:
        return ("force_n",)
    return perturbation.graded if isinstance(perturbation, ByLot) else ()


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


def sensing(perturbation: Perturbation, *, falls: float, lot: float) -> Injection:
    """What a perturbation does to an exposure, by two draws, uniform in [0, 1).

    Args:
        perturbation: The condition.
        falls: Decides whether it hits.
        lot: Decides how hard, where that varies.
    """
    if not isinstance(perturbation, ExposurePerturbation) or falls >= perturbation.probability:
        return Injection()
    return perturbation.hit(lot)


@dataclass(frozen=True)
class Push:
    """One sideways push on the hand.

    Attributes:
        time_s: When it begins, s after the start, or after contact begins.
        force_n: Sideways force, N, signed.
        duration_s: How long, s.
        in_contact: Whether it waits for a phase of contact.
    """

    time_s: float
    force_n: float
    duration_s: float
    in_contact: bool = False


def pushes(
    perturbation: Perturbation, *, root_seed: int, name: str, start: int
) -> tuple[Push, ...]:
    """The pushes of this start; none where the perturbation pushes nobody."""
    if not isinstance(perturbation, SidewaysPush):
        return ()
    generator = stream(root_seed, "push", name, start)
    found = []
    for force_n, window_s in (
        (perturbation.force_n, OPEN_PUSH_S),
        (perturbation.contact_force_n, CONTACT_PUSH_S),
    ):
        sign = 1.0 if generator.random() < 0.5 else -1.0
        time_s = float(generator.uniform(*window_s))
        in_contact = window_s is CONTACT_PUSH_S
        found.append(Push(time_s, sign * force_n, PUSH_DURATION_S, in_contact))
    return tuple(push for push in found if push.force_n != 0.0)


def drill_s(perturbation: Perturbation, *, root_seed: int, name: str, start: int) -> float | None:
    """When recovery is called for in this start, s after it; None where there is no drill."""
    if not isinstance(perturbation, RecoveryDrill):
        return None
    return float(stream(root_seed, "drill", name, start).uniform(*DRILL_S))
