"""Names of the monitors, for who reads settings or tables and needs no monitor."""

TIME, VARIANCE = "time_in_episode", "sample_variance"
CONTROLS = (TIME, VARIANCE)
"""Shown beside every monitor, and never taken for one."""
KINDS = (
    "support", "encoder_distance", "own_loss", "chunk_consistency", "log_density",
    "seed_disagreement",
)  # fmt: skip
"""The others, in the order of the registry, which loads torch."""
