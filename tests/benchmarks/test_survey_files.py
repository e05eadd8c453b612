"""The files of the benchmark of large files hold the forest that they are made of."""

from pathlib import Path

import numpy as np

from benchmarks.survey_files import WRITERS, forest
from server.stem_maps.reader import read_stem_map
from server.stem_maps.reading.options import ReadOptions


def test_each_format_holds_the_same_forest(tmp_path: Path) -> None:
    xy, dbh_cm = forest(300)
    for suffix, write in WRITERS.items():
        path = tmp_path / f"forest{suffix}"
        write(path, xy, dbh_cm)
        read = read_stem_map(path, ReadOptions(crs="EPSG:25832" if suffix == ".csv" else None))
        assert (read.crs, len(read)) == ("EPSG:25832", 300)
        np.testing.assert_allclose(read.xy, xy, atol=0.002)
        assert suffix == ".laz" or (read.dbh_cm is not None and read.dbh_cm.tolist() == dbh_cm.tolist())
