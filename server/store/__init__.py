"""The tables of the database, the records that stand for their rows, how columns are encoded, the schema's versions.

`sqlite/` holds the file, `repositories/` the queries. Rows of tables are used only here.
Imports `store.sqlite`, `platform` and `errors`.
"""
