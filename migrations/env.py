"""Alembic's entry: runs on the connection, and in the transaction, that the caller hands in."""

from alembic import context
from sqlalchemy import Connection


def run() -> None:
    """Run the migrations that were asked for."""
    connection = context.config.attributes.get("connection")
    if not isinstance(connection, Connection):
        raise RuntimeError("run migrations by `urquhart db upgrade`, which hands in a connection")
    # SQLite's schema statements are transactional as long as BEGIN is explicit, which it is here.
    context.configure(connection=connection, transactional_ddl=True)
    with context.begin_transaction():
        context.run_migrations()


run()
