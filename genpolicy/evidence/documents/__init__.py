"""JSON documents of the evidence that gates read: one module a stage, a frozen dataclass a kind.

Stages write these classes and gates read them, so a key is spelled here and nowhere else. What
training and ingest write is in `given`: those stages stand below and know nothing of this package.
"""
