"""The audit's settings in the benchmark: its defaults, with fewer queries.

One for each task and the same for all of its data sets; lengths are in metres in both.
"""

from genpolicy.audit.settings import AuditSettings

PLANAR = AuditSettings(
    position_channel="tcp", reference_channel="goal", calibration_phase="release",
    context_channels=["goal", "lamp"], ignored_channels=[], query_stride=4,
)  # fmt: skip
INSERTION = AuditSettings(
    calibration_phase="release", context_channels=["hole_pose", "lamp"], query_stride=4,
    maximum_queries_per_phase=250,
)  # fmt: skip
SETTINGS = {"planar": PLANAR, "insertion": INSERTION}
