"""The database schema's history, run by `server.store.schema`."""
