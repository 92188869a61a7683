"""Somebody's policy in a process of its own: what it is, how it is asked, what its answers mean."""
