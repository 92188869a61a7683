"""Names of the questions that depend on what was recorded or given, as they may be waived.

Which of them these data ask is known afterwards; which could be asked at all is known before, from
the code, the task's phases and its contract. A waiver is held against the latter.
"""

from genpolicy.audit.variable import EPISODE_VARIABLES

ALWAYS = (
    "units_frames_and_lag", "constant_lag", "calibration_at_reference", "calibration_at_rest",
    "labels", "feasibility", *EPISODE_VARIABLES, "order",
)  # fmt: skip
"""Asked, or said not to be, of all data."""
CLOCK, FROZEN, PAST = "clock.", "frozen.", "past."
"""Begin the questions of a stream, of which there are two, and of a phase."""
COLUMN = "column."
"""Begins those of a recorded column, which no declaration names: recordings bring any."""
OUTCOME_MISSING = "outcome: not recorded, so no mode can be called valid."
"""Stands under what a report rests on where no episode has an outcome."""
