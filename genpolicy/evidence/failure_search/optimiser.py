"""Asks for points of the unit cube, one generation after the other, and is told their worth.

The optimiser is CMA-ES of the library `cmaes` (Hansen's tutorial, arXiv 1604.00772), with its own
defaults of population and rates: it follows a slope, needs none, and bears noise. It begins again
from a drawn point where it has converged, since a boundary may have several places.
"""

from collections.abc import Callable, Sequence

import numpy as np
from cmaes import CMA
from numpy.typing import NDArray

from genpolicy.evidence.failure_search.settings import FIRST_SPREAD

Array = NDArray[np.float64]
Evaluate = Callable[[Sequence[Array]], Sequence[float]]

LARGEST_SEED = 2**32


def search(
    evaluate: Evaluate, *, dimensions: int, evaluations: int, generator: np.random.Generator
) -> None:
    """Look for points of low worth, with exactly so many evaluations.

    What is asked for depends on the generator and on the worths that were told, and on nothing
    else: whoever tells the same worths again is asked for the same points again.

    Args:
        evaluate: Worth of each point of a generation; points have shape (dimensions,), in [0, 1].
        dimensions: Coordinates of a point, >= 1.
        evaluations: How many points in all, >= 0.
        generator: Of this search alone.
    """
    optimiser = _begun(np.full(dimensions, 0.5), generator)
    left = evaluations
    while left > 0:
        points = [optimiser.ask() for _ in range(min(optimiser.population_size, left))]
        worths = evaluate(points)
        left -= len(points)
        if left == 0:
            break  # what the last generation taught, nobody asks
        optimiser.tell([(point, float(w)) for point, w in zip(points, worths, strict=True)])
        if optimiser.should_stop():
            optimiser = _begun(generator.random(dimensions), generator)


def _begun(mean: Array, generator: np.random.Generator) -> CMA:
    bounds = np.tile([0.0, 1.0], (len(mean), 1))
    seed = int(generator.integers(LARGEST_SEED))
    return CMA(mean=mean, sigma=FIRST_SPREAD, bounds=bounds, seed=seed)
