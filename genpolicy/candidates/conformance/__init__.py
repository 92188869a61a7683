"""What a policy behind the wire does, before any gate asks it."""
