"""The index of each collection: caught up before use, written to segments, merged, checked.

Derived from rows, so it can always be rebuilt. Imports `store`, `observability` and below.
"""
