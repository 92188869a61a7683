"""How often the ladder is right: wrongs planted in small ladders, and honest changes."""
