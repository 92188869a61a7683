"""Exact intervals, multiplicity, sequential and conditional tests."""
