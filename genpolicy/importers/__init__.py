"""Recordings of others to our dataset contract: one importer per layout, each refusing by name."""
