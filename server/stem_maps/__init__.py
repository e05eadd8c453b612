"""Stem maps: read from files, cut into overlapping discs or into plots, stored as submaps.

Imports `submaps` and below; only commands use it.
"""
