"""A process over a database, as the tests of the index use it."""

from collections.abc import Iterator

import pytest

from server.collections import crud
from server.schemas.collections import CollectionPut
from server.store.sqlite.database import Database
from tests.server.index.index_helpers import Process


@pytest.fixture
def process(database: Database) -> Iterator[Process]:
    """A process over a database with the empty collection `plots`."""
    crud.ensure(database, "plots", CollectionPut())
    made = Process(database.path)
    yield made
    made.close()
