"""The SQLite file: connections, transactions, its lock, and errors translated to the domain's.

The only room that knows SQLite. Imports `platform` and `errors`.
"""
