"""The eleven terms of latency, measured and summarised."""
