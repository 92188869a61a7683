"""Journals as a 3-D viewer shows them: the same events, with what stood and moved beside them."""
