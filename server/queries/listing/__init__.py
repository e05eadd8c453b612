"""Lists of stored queries."""
