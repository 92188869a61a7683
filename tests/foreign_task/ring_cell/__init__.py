"""A probe held over a pad: another arm, other phases, no gripper, no contact physics."""
