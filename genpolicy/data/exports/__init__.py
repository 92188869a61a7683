"""Ways out of a dataset, into layouts that others train from."""
