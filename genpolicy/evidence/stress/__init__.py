"""Evidence of Gate D: matched closed-loop comparison on the virtual clock."""
