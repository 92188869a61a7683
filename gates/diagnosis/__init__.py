"""Diagnosis: where to look first, and what each symptom's numbers say, from judged reports."""
