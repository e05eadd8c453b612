"""The database schema's history, run by `server.store.migrations_runner`."""
