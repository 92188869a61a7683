"""An independent checker of journals, and the mutants that keep it awake."""
