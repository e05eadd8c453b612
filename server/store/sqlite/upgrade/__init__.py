"""A database of an older version brought to this one: its tables, their rows, and the features of its submaps.

Imports `store.sqlite` and below.
"""
