"""Density beside mode coverage: what a head says of each mode, and how often it goes there.

A share of samples needs no likelihood and sees only what was drawn; a density needs no samples and
sees only the chunk that it is asked for. Where a head states one, both are asked of the same modes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import POSITION
from genpolicy.data.dataset import Dataset
from genpolicy.errors import NonFiniteError
from genpolicy.evidence.need.held_out import HeldOut
from genpolicy.evidence.need.method_modes import sample_modes
from genpolicy.evidence.rows.reproducibility import DensityRow
from genpolicy.policies.density import DENSITIES, log_density
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.seeds import stream

Array = NDArray[np.float64]

SITUATIONS = 16
"""Situations asked, of all that the audit found: 0.3 s a mode, so ten seconds a method."""
SAME_SHAPE_M = 1e-6
"""Paths closer than this are one path: they differ by the rounding of where they were moved to."""


@dataclass(frozen=True)
class ModalChunk:
    """The demonstrated chunk behind a mode of the audit.

    Attributes:
        actions: All numbers, moved onto the path of the mode, physical units. Shape (K, D_a).
        shape_distance_m: RMS distance of the two paths, m.
        moved_m: How far it was moved, m.
    """

    actions: Array
    shape_distance_m: float
    moved_m: float


def drawn_situations(held_out: HeldOut, *, most: int = SITUATIONS) -> HeldOut:
    """At most so many situations, by a draw that depends on their number only."""
    count = len(held_out.situations)
    if count <= most:
        return held_out
    draw = stream(0, "density", "situations")
    chosen = np.sort(draw.choice(count, size=most, replace=False))
    return HeldOut(
        tuple(held_out.situations[place] for place in chosen), held_out.observations[chosen]
    )


def density_rows(
    policy: NetworkPolicy, held_out: HeldOut, data: Dataset, *, seed: int, samples: int
) -> list[DensityRow]:
    """Rows of `density.parquet` of one checkpoint; none of a method that states no density.

    The samples are those of `modes.parquet`: drawn again under their names, they are the same.

    Args:
        policy: The checkpoint under its own sampler.
        held_out: Situations to ask.
        data: The dataset.
        seed: Number of its training seed.
        samples: Candidates per situation.
    """
    if policy.method not in DENSITIES or not held_out.situations:
        return []
    names = [("modes", s.episode_uuid, s.index) for s in held_out.situations]
    asked = policy.sample(held_out.observations, noise_names=names, candidates=samples)
    drawn = asked.actions
    demonstrated = _demonstrated(data, held_out, policy.prediction_horizon)
    rows = []
    for situation, observation, chunks in zip(
        held_out.situations, held_out.observations, drawn, strict=True
    ):
        found = sample_modes(chunks, situation.mode_paths, position=POSITION)
        reached = found.counts(np.ones(len(chunks), dtype=np.bool_))
        modes = [modal_chunk(path, demonstrated) for path in situation.mode_paths]
        densities = _log_densities(policy, observation, modes)
        rows += [
            DensityRow(
                method=policy.method,
                seed=seed,
                episode_uuid=situation.episode_uuid,
                index=situation.index,
                mode=number,
                log_density=float(densities[number]),
                shape_distance_m=mode.shape_distance_m,
                moved_m=mode.moved_m,
                samples=len(chunks),
                reached=int(reached[number]),
            )
            for number, mode in enumerate(modes)
        ]
    return rows


def _log_densities(policy: NetworkPolicy, observation: Array, modes: Sequence[ModalChunk]) -> Array:
    """Of each mode, nats; NaN where the weights give no numbers. Shape (M,)."""
    try:
        return log_density(
            policy,
            np.repeat(observation[None], len(modes), axis=0),
            np.stack([mode.actions for mode in modes]),
        )
    except NonFiniteError:
        return np.full(len(modes), np.nan)


def modal_chunk(path: Array, demonstrated: Array) -> ModalChunk:
    """The demonstrated chunk whose path has the shape of a mode, moved onto it.

    The audit's modes are demonstrated chunks moved to where the arm stands, of which it keeps the
    positions only; rotations and gripper come back from the demonstration.

    Args:
        path: Positions of the mode, m. Shape (K_m, 3).
        demonstrated: Chunks to look among, physical units. Shape (N, K, D_a).
    """
    steps = min(demonstrated.shape[1], len(path))
    offsets = path[:steps] - demonstrated[:, :steps, POSITION]
    moves = offsets.mean(axis=1)
    residuals = np.sqrt(np.square(offsets - moves[:, None]).sum(axis=2).mean(axis=1))
    lengths = np.linalg.norm(moves, axis=1)
    # Of paths of one shape, an arm at rest say, the nearest: its other numbers fit best.
    nearest = int(np.lexsort((lengths, np.round(residuals / SAME_SHAPE_M)))[0])
    actions = demonstrated[nearest].copy()
    actions[:, POSITION] += moves[nearest]
    return ModalChunk(actions, float(residuals[nearest]), float(lengths[nearest]))


def _demonstrated(data: Dataset, held_out: HeldOut, prediction_horizon: int) -> Array:
    """Chunks at every row of the training split and of the splits that ask. Shape (N, K, D_a)."""
    asking: Sequence[str] = sorted({"train", *(s.split for s in held_out.situations)})
    return np.concatenate(
        [
            data.windows(
                split,
                observation_horizon=1,
                prediction_horizon=prediction_horizon,
                only_success=False,
            ).actions
            for split in asking
        ]
    )
