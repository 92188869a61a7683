"""Names of the two controls, for who reads tables and needs no monitor."""

TIME, VARIANCE = "time_in_episode", "sample_variance"
CONTROLS = (TIME, VARIANCE)
"""Shown beside every monitor, and never taken for one."""
