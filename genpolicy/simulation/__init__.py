"""The virtual clock: latency, perturbations, rollouts, matched comparison."""
