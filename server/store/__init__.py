"""The tables of the database, the records that stand for their rows, how columns are encoded, the schema's versions.

`storage` is the seam to the rooms above: transactions with `repositories/`, which take and give records. `sqlite/` is
the implementation. SQL and rows of tables are used only here. Imports `platform` and `errors`.
"""
