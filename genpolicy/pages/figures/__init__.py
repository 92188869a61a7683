"""Figures for self-contained pages: drawn without a display, the same bytes every time."""
