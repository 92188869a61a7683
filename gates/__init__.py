"""Criteria, verdicts, admission, signing, reports."""
