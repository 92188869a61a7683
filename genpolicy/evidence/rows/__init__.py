"""Rows of the evidence tables that gates read, one frozen dataclass a table.

Field order is column order. Stages write these rows and gates read them, so a column is spelled
here and nowhere else. The tables of the audit stand with the audit, fixtures with the policies.
Text and identities are `str`, counts whole numbers; None is "not reached" or "not measured",
never zero.
"""
