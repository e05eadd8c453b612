"""Bodies of maps."""
