"""Latency on the virtual clock: each term of an invocation drawn from what was measured.

Compute terms come from the measured distribution of each method; sensor, network and queue
terms from the declared schedule. The random number behind a draw is keyed by perturbation,
start, invocation and term, and not by the method: where a term is the same for two methods,
so is the draw, and where it is not, both get the same quantile of their own distribution.
The term `project` is the check of one candidate. A selector that must try another one takes as
long again, so that a policy whose candidates are refused answers later.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from genpolicy.contract.latency import DECLARED_TERMS, MEASURED_TERMS, Term
from genpolicy.contract.settings import Settings
from genpolicy.errors import ConfigError, ContractError
from genpolicy.seeds import stream

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DeclaredTerm:
    """A term that no benchmark on this machine can measure: uniform between two bounds.

    Attributes:
        minimum_s: Smallest duration, s.
        maximum_s: Largest duration, s.

    Raises:
        ConfigError: Bounds that are no times, or the wrong way round.
    """

    minimum_s: float
    maximum_s: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.minimum_s <= self.maximum_s < math.inf:
            raise ConfigError(
                where="params.yaml: latency.declared",
                found=f"[{self.minimum_s}, {self.maximum_s}]",
                expected="least and most of a duration, s: 0 <= least <= most, finite",
                action="Correct the bounds; an unknown term is not zero.",
            )


class LatencySection(Settings):
    """Section `latency`.

    Attributes:
        warm: Warm invocations of each process.
        cold: Cold invocations of each process.
        declared: Least and most of each term that this machine cannot measure, s.
    """

    warm: int = Field(ge=20)
    cold: int = Field(ge=2)
    declared: dict[str, Annotated[list[float], Field(min_length=2, max_length=2)]]

    @property
    def declared_terms(self) -> dict[str, DeclaredTerm]:
        """Bounds of the terms that this machine cannot measure."""
        return {name: DeclaredTerm(bounds[0], bounds[1]) for name, bounds in self.declared.items()}


@dataclass(frozen=True)
class LatencyModel:
    """All terms of one method.

    Attributes:
        declared: Sensor, network and queue terms.
        measured: Sorted warm durations by compute term, s.
        cold_extra_s: What the first invocation of a session costs on top, s.
    """

    declared: Mapping[str, DeclaredTerm]
    measured: Mapping[str, Array]
    cold_extra_s: float

    def __post_init__(self) -> None:
        for names, have in ((DECLARED_TERMS, self.declared), (MEASURED_TERMS, self.measured)):
            missing = [str(name) for name in names if name not in have]
            if missing:
                raise ContractError(
                    where="latency model",
                    found=f"without the terms {missing}",
                    expected="all eleven terms; a missing term is unknown, never zero",
                    action="Run the latency stage (`dvc repro latency`).",
                )


@dataclass(frozen=True)
class LatencyDraw:
    """Terms of one invocation, s, by name; their sum is the end-to-end latency."""

    terms: Mapping[str, float]

    @property
    def total_s(self) -> float:
        """Sensor event to delivery at the executor, s."""
        return float(sum(self.terms.values()))


def draw_latency(
    model: LatencyModel,
    *,
    root_seed: int,
    perturbation: str,
    start: int,
    invocation: int,
    extra_s: Mapping[str, float],
    compute_factor: float,
) -> LatencyDraw:
    """Latency of one invocation.

    Args:
        model: Distributions of the method.
        root_seed: Root seed of the ladder.
        perturbation: Name of the perturbation, part of the key.
        start: Index of the initial state, part of the key.
        invocation: Count of invocations in this rollout, part of the key.
        extra_s: What the perturbation adds to a term, s.
        compute_factor: What compute contention multiplies measured terms by, >= 1.

    Returns:
        The eleven terms, s.
    """
    terms: dict[str, float] = {}
    for name in map(str, (*DECLARED_TERMS, *MEASURED_TERMS)):
        uniform = float(
            stream(root_seed, "latency", perturbation, start, invocation, name).random()
        )
        if name in model.declared:
            bounds = model.declared[name]
            value = bounds.minimum_s + uniform * (bounds.maximum_s - bounds.minimum_s)
        else:
            value = compute_factor * empirical_quantile(model.measured[name], uniform)
        terms[name] = value + extra_s.get(name, 0.0)
    if invocation == 0:
        terms["sample"] += model.cold_extra_s
    return LatencyDraw(terms)


def draw_check(
    model: LatencyModel,
    *,
    root_seed: int,
    perturbation: str,
    start: int,
    invocation: int,
    candidate: int,
    compute_factor: float,
) -> float:
    """What it takes to check one candidate more, after another one was refused, s.

    Arguments as in `draw_latency`; `candidate` from 1, the first is in its `project`.
    """
    name = str(Term.PROJECT)
    key = ("latency", perturbation, start, invocation, name, candidate)
    uniform = float(stream(root_seed, *key).random())
    return compute_factor * empirical_quantile(model.measured[name], uniform)


def empirical_quantile(sorted_values: Array, level: float) -> float:
    """Order statistic at `level` in [0, 1) of sorted values; never interpolated."""
    return float(sorted_values[min(len(sorted_values) - 1, int(level * len(sorted_values)))])
