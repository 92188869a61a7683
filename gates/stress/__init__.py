"""Gate D, matched simulation and stress: is the gain larger than its cost?"""
