"""Whoever answers in the child: what an entry names is loaded, run, and served over the wire."""
