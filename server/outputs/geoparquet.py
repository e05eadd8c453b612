"""Tables as GeoParquet 1.1 files, through pyarrow: points and polygons as well-known binary, the CRS as PROJJSON."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np

from server.outputs.extras import import_extra
from server.outputs.tables import OutputLayer, OutputRows, bounds_of, well_known_binary

_VERSION: Final = "1.1.0"
_GEOMETRY: Final = "geometry"


def write_geoparquet(path: Path, layer: OutputLayer, batches: Iterable[OutputRows]) -> int:
    """Write a layer to the file `path`. Returns the number of rows.

    Raises:
        NotAcceptable: the package that writes the format is not installed.
        OSError: the file cannot be written.
    """
    pa = import_extra("pyarrow", "parquet", "GeoParquet")
    parquet = import_extra("pyarrow.parquet", "parquet", "GeoParquet")
    types = {
        "text": pa.string(),
        "real": pa.float64(),
        "integer": pa.int64(),
        "boolean": pa.bool_(),
        "time": pa.timestamp("us", tz="UTC"),
    }
    fields = [(column.name, types[column.kind]) for column in layer.columns]
    schema = pa.schema([*fields, (_GEOMETRY, pa.binary())])
    count, box = 0, np.array([np.inf, np.inf, -np.inf, -np.inf])
    with parquet.ParquetWriter(str(path), schema, compression="zstd") as writer:
        for rows in batches:
            if not len(rows):
                continue
            shapes = well_known_binary(layer, rows)
            columns = [pa.array(list(values), type=kind) for (_, kind), values in zip(fields, rows.values, strict=True)]
            writer.write_table(pa.table([*columns, pa.array(shapes, type=pa.binary())], schema=schema))
            found = bounds_of(layer, rows)
            box = np.concatenate([np.minimum(box[:2], found[:2]), np.maximum(box[2:], found[2:])])
            count += len(rows)
        writer.add_key_value_metadata({"geo": json.dumps(geo_metadata(layer, box.tolist()))})
    return count


def geo_metadata(layer: OutputLayer, box: list[float]) -> dict[str, Any]:
    """The metadata `geo` of a file. `box`: min x, min y, max x, max y of its shapes, not finite if there are none."""
    column: dict[str, Any] = {
        "encoding": "WKB",
        "geometry_types": [layer.shape],
        "crs": layer.crs.to_json_dict(),
        "edges": "planar",
    }
    if np.isfinite(box).all():
        column["bbox"] = box
    return {"version": _VERSION, "primary_column": _GEOMETRY, "columns": {_GEOMETRY: column}}
