"""Recordings as others make them: each base with what is true of it."""
