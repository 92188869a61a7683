"""The caveat ledger: what papers say, how far it carries here, and nothing that judges by it."""
