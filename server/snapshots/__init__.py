"""Copies of the whole database: made while the service runs, listed, proven, restored.

Imports `checks`, `collections`, `resources` and below.
"""
