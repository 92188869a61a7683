"""Does what a latent changes depend on the observation, or is it the same style everywhere?

The same latents are decoded at every held-out situation. What they change there is the deviation
of their chunks from the situation's own mean chunk. If situations with like observations have
like deviations, the latent answers the task; if the deviations are the same everywhere, or differ
without regard to the observation, it encodes style or noise. Held apart by a permutation test on
the distance covariance of observations and deviations (Szekely, Rizzo and Bakirov 2007).
"""

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import POSITION
from genpolicy.evidence.documents.need import Dependence, is_the_same
from genpolicy.evidence.need.held_out import HeldOut
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.protocol import NoiseName
from genpolicy.seeds import stream

Array = NDArray[np.float64]

SHARED_NOISE: NoiseName = ("latent",)


def latent_dependence(
    policy: NetworkPolicy,
    held_out: HeldOut,
    *,
    samples: int,
    permutations: int,
    root_seed: int,
) -> Dependence:
    """Hold the latent of a trained policy against the observations of held-out situations.

    Args:
        policy: Policy that draws a latent.
        held_out: Independent situations.
        samples: Latents, the same at every situation.
        permutations: Permutations of the test.
        root_seed: Seed of the permutations.
    """
    drawn = policy.sample(
        held_out.observations,
        noise_names=[SHARED_NOISE] * len(held_out.situations),
        candidates=samples,
    ).actions
    # A latent that gives no numbers somewhere says nothing; with none left, nothing varies.
    whole = np.isfinite(drawn).all(axis=(0, 2, 3))
    normalised = policy.checkpoint.normalisation.observation.normalise(held_out.observations)
    return dependence(
        normalised.reshape(len(normalised), -1),
        (drawn[:, whole] if whole.any() else np.zeros_like(drawn[:, :1]))[..., POSITION],
        permutations=permutations,
        rng=stream(root_seed, "latent_dependence"),
    )


def dependence(
    observations: Array, paths: Array, *, permutations: int, rng: np.random.Generator
) -> Dependence:
    """Dependence of what shared latents change on the observations.

    Args:
        observations: Normalised. Shape (S, D).
        paths: Positions of the chunks of the same N latents at each situation, m.
            Shape (S, N, K, P).
        permutations: Permutations of the test.
        rng: Generator of the permutations.
    """
    count = len(observations)
    deviations = paths - paths.mean(axis=1, keepdims=True)
    square = np.square(deviations).sum(axis=-1)
    common = deviations.mean(axis=0, keepdims=True)
    differing = np.square(deviations - common).sum(axis=-1).mean()
    share = float(differing / square.mean()) if square.mean() > 0.0 else 0.0
    seen, changed = (
        _centred(_distances(values.reshape(count, -1))) for values in (observations, deviations)
    )
    spread_m = float(np.sqrt(square.mean()))
    if is_the_same(share, spread_m):
        changed = np.zeros_like(changed)
    scale = float(np.sqrt(np.square(seen).mean() * np.square(changed).mean()))
    measured = float((seen * changed).mean())
    exceeding = permutations
    if scale > 0.0:
        exceeding = 0
        for _ in range(permutations):
            order = rng.permutation(count)
            permuted = float((seen * changed[np.ix_(order, order)]).mean())
            exceeding += permuted >= measured
    return Dependence(
        situations=count,
        spread_m=spread_m,
        condition_share=share,
        distance_correlation=float(np.sqrt(max(0.0, measured) / scale)) if scale > 0.0 else 0.0,
        exceeding=exceeding,
        permutations=permutations,
    )


def _distances(rows: Array) -> Array:
    squares = np.square(rows).sum(axis=1)
    between = squares[:, None] + squares[None] - 2.0 * rows @ rows.T
    np.fill_diagonal(between, 0.0)
    distances: Array = np.sqrt(np.maximum(between, 0.0))
    return distances


def _centred(distances: Array) -> Array:
    rows = distances.mean(axis=0)
    centred: Array = distances - rows[:, None] - rows[None] + rows.mean()
    return centred
