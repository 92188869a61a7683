"""Gate E: the trial card, its draft, its signatures and its judge."""
