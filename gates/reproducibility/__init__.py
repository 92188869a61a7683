"""Gate B, reproducibility: is a candidate pinned, and does it come back the same?"""
