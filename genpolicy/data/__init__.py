"""Recordings, datasets, and the formats of others: one contract, one way in."""
