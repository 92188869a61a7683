"""Recordings of others to our dataset contract: one importer per layout, each refusing by name."""

from genpolicy.data.formats.opening import FORMATS, open_dataset, propose
from genpolicy.data.formats.result import Opened

__all__ = ["FORMATS", "Opened", "open_dataset", "propose"]
