"""One network, swapped heads, own samplers, verified checkpoints."""
