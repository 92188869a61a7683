"""The command `genpolicy`: audit or ingest a dataset of one's own, without DVC."""
