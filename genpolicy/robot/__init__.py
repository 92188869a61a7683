"""Limits, kinematics and collision of the arm, from the one scene file."""
