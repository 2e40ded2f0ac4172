"""Speed of flipdiagram against its targets: `make bench`."""
