"""The audit's own audit: labelled data sets with planted causes, and how often it is right."""
