"""Polygons in segments, which several modules read and none changes."""

import pytest

from tests.urquhart.polygons import Rows, listed_pentagons, pentagons, small_submaps
from urquhart.features.describe import Features
from urquhart.index.polygon_search import Partition


@pytest.fixture(scope="session")
def real() -> tuple[Partition, Rows]:
    """Stored pentagons of a forest, and others of it as queries."""
    return pentagons()


@pytest.fixture(scope="session")
def inverted(real: tuple[Partition, Rows]) -> Partition:
    """The stored pentagons in lists."""
    return listed_pentagons(real[0])


@pytest.fixture(scope="session")
def submaps() -> list[Features]:
    """Submaps with few polygons, one of them with none."""
    return small_submaps()
