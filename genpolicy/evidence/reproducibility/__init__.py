"""Evidence of Gate B: reload, sweep, latency."""
