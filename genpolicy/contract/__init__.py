"""Action, observation, chunk, horizons, normalisation: what every piece agrees on."""
