"""The database schema's history, run by `server.store.sqlite.upgrade.migrations_runner`."""
