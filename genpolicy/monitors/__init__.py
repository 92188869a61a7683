"""Monitors: how far an invocation lies from what was trained on.

Diagnostics that are computed after a rollout, from what its journal recorded. No code that decides
what a robot does imports this package, and none of these scores starts, clears or masks a stop.
"""
