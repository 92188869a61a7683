"""Gate C, feasibility and time: does anything invalid or stale ever reach the controller?"""
