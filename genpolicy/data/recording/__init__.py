"""Episodes as MCAP, written and read with every check on."""
