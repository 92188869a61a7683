"""How often Gate D decides wrongly, on simulated evidence of which the truth is known."""
