"""Which mode the controller below every policy must be in.

A chunk is a row of TCP poses; what they do depends on who tracks them. The pose that an impedance
controller (`impedance`) leans towards is a blow in a position mode.
"""

CONTROLLER_MODE = "cartesian_impedance"
"""The mode in which commands of this project mean what they were checked for."""
