"""One module per kind of row: its SELECTs and writes, within a session that the caller holds.

Imports `store` and `store.sqlite`; no room above the store writes SQL for these rows.
"""
