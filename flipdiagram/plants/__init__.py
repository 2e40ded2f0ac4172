"""Plants: the physics that a controller drives."""
