"""The version of the tables that this version of the service works with, and where its migrations are."""

from functools import cache
from importlib import resources

from alembic.config import Config
from alembic.script import ScriptDirectory
from sqlalchemy import Connection


@cache
def expected_revision() -> str:
    """The schema revision that this version of the service works with."""
    head = ScriptDirectory.from_config(alembic_config()).get_current_head()
    if head is None:
        raise RuntimeError("the package `migrations` holds no revision")
    return head


def alembic_config(connection: Connection | None = None) -> Config:
    """The configuration of the migrations, to be run on a connection if one is given."""
    config = Config()
    config.set_main_option("script_location", str(resources.files("migrations")).replace("%", "%%"))
    config.attributes["connection"] = connection
    return config
