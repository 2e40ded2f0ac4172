"""Studies: what the paper measured, and beyond."""
