"""Perturbation schedules: what is injected at which invocation, the same for every method.

A schedule is a pure function of root seed, perturbation, start and invocation. It never sees
the method, so two methods on the same start meet the same world.
"""

from dataclasses import dataclass, field
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from genpolicy.seeds import stream

PerturbationKind = Literal[
    "nominal", "camera_delay", "compute_contention", "network_jitter", "queue_reorder",
    "chunk_drop", "push",
]  # fmt: skip


class PerturbationSettings(BaseModel):
    """One perturbation of the matched comparison.

    Attributes:
        kind: What is injected.
        probability: Share of invocations that it hits.
        magnitude_s: Added delay, s (camera delay, network jitter, reorder).
        factor: Compute slow-down (contention).
        force_n: Push on the hand, N, sideways, once per rollout.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    kind: PerturbationKind
    probability: float = Field(default=1.0, ge=0.0, le=1.0)
    magnitude_s: float = Field(default=0.0, ge=0.0)
    factor: float = Field(default=1.0, ge=1.0)
    force_n: float = Field(default=0.0, ge=0.0)


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


def injection(
    settings: PerturbationSettings, *, root_seed: int, name: str, start: int, invocation: int
) -> Injection:
    """What the perturbation `name` does to an invocation; nothing, if its lot does not fall."""
    generator = stream(root_seed, "perturbation", name, start, invocation)
    hit = float(generator.random()) < settings.probability
    size = float(generator.random()) * settings.magnitude_s
    if not hit or settings.kind in ("nominal", "push"):
        return Injection()
    if settings.kind == "camera_delay":
        return Injection(extra_s={"capture": settings.magnitude_s})
    if settings.kind == "compute_contention":
        return Injection(compute_factor=settings.factor)
    if settings.kind == "network_jitter":
        return Injection(extra_s={"network": size})
    if settings.kind == "queue_reorder":
        return Injection(extra_s={"queue": settings.magnitude_s})
    return Injection(dropped=True)


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


def push(settings: PerturbationSettings, *, root_seed: int, name: str, start: int) -> Push | None:
    """The push of this start, or none where the perturbation pushes nobody."""
    if settings.kind != "push" or settings.force_n == 0.0:
        return None
    generator = stream(root_seed, "push", name, start)
    sign = 1.0 if generator.random() < 0.5 else -1.0
    return Push(
        time_s=float(generator.uniform(0.3, 1.5)), force_n=sign * settings.force_n, duration_s=0.2
    )
