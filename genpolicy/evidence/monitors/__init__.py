"""Gate D's evidence on monitors: probes of the embedded task, scored after they were run."""
