"""The monitors by name, the two controls last."""

from collections.abc import Callable

from genpolicy.monitors.consistency import ChunkConsistency
from genpolicy.monitors.controls import SampleVariance, TimeInEpisode
from genpolicy.monitors.disagreement import SeedDisagreement
from genpolicy.monitors.encoder import EncoderDistance
from genpolicy.monitors.log_density import LogDensity
from genpolicy.monitors.names import TIME, VARIANCE
from genpolicy.monitors.own_loss import OwnLoss
from genpolicy.monitors.protocol import Fit, Monitor, Unavailable
from genpolicy.monitors.support import Support

MONITORS: dict[str, Callable[[Fit], Monitor | Unavailable]] = {
    "support": Support.fitted,
    "encoder_distance": EncoderDistance.fitted,
    "own_loss": OwnLoss.fitted,
    "chunk_consistency": ChunkConsistency.fitted,
    "log_density": LogDensity.fitted,
    "seed_disagreement": SeedDisagreement.fitted,
    TIME: TimeInEpisode.fitted,
    VARIANCE: SampleVariance.fitted,
}
READ_DRAWS = ("own_loss", "chunk_consistency", "log_density", "seed_disagreement", VARIANCE)
"""Those whose score hangs on what an invocation drew; the others ask what it saw, and when."""
