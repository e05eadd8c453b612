"""Stem maps: read from CSV, cut into overlapping discs, stored as submaps."""
