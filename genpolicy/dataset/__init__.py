"""Recordings to a verified dataset."""
