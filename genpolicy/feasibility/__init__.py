"""Projection and the six layers; the only maker of admitted chunks."""
