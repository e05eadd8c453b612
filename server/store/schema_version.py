"""The version of the tables that this version of the service works with, and where its migrations are."""

from importlib import resources
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from alembic.config import Config
    from sqlalchemy import Connection

SCHEMA: Final = "0014"
"""The newest revision in `migrations/versions`. A constant, because alembic takes a tenth of a second to load and is
needed only to make or change tables. A test holds it to what alembic finds."""


def expected_revision() -> str:
    """The schema revision that this version of the service works with."""
    return SCHEMA


def alembic_config(connection: "Connection | None" = None) -> "Config":
    """The configuration of the migrations, to be run on a connection if one is given."""
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(resources.files("migrations")).replace("%", "%%"))
    config.attributes["connection"] = connection
    return config
