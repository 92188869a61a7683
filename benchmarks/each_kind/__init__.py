"""The small ladder judges its own weights as a candidate of each kind, and policies of LeRobot."""
