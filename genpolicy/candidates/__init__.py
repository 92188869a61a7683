"""What is judged: one interface for everything that stands in a comparison."""
