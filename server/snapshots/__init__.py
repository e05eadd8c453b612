"""Snapshots: copies of the whole database, created while the service runs, listed, verified, restored.

Imports `checks`, `collections`, `resources` and below.
"""
