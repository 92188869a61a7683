"""The wall-clock mode: supervisor and controller stub in a process of their own, on recordings."""
