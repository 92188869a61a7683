"""Recordings of others to our dataset contract: one importer per layout, each refusing by name."""

from genpolicy.importers.opening import FORMATS, open_dataset, propose
from genpolicy.importers.result import Opened

__all__ = ["FORMATS", "Opened", "open_dataset", "propose"]
