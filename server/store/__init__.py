"""The tables of the database, how columns are encoded, and the versions of the schema.

`sqlite/` holds the file, `repositories/` the queries. Imports `store.sqlite`, `platform` and `errors`.
"""
