"""Evidence of Gate A: held-out modes, baselines, factors."""
