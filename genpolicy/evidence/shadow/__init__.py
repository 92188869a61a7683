"""Evidence of Gate C: candidates down to the stub, corruptions, mutants."""
