"""One module per kind of row: a class that reads, and one that also writes, on a connection that the caller holds.

The rooms above reach them through a transaction of `store.storage`. Imports `store`.
"""
