"""The contact controller of the simulated cell; a pinned fixture."""
