"""Hashes, strict documents, checked tables, atomic writes."""
