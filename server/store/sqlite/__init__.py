"""The SQLite file: connections, transactions, its lock, and errors translated to the domain's.

The only room that knows SQLite, but for a word in the definitions of the tables. Implements `store.storage`, and
imports that, `platform` and `errors`.
"""
