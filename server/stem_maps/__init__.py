"""Stem maps: read from CSV, cut into overlapping discs, stored as submaps.

Imports `submaps` and below; only commands use it.
"""
