"""Feature collections: two of each collection, its landmarks and its submaps, with what a GIS wants to know of them."""

from collections.abc import Sequence
from typing import Any, Final
from urllib.parse import quote

from server.collections.crud import get_collection
from server.collections.frame_systems import frame_systems
from server.config.settings import Limits
from server.exports.selection import DEGREES, ExportPlaces
from server.ogc.boxes import degrees_of
from server.ogc.items import FeatureKind, ItemSource
from server.resources.paging import read_cursor, write_cursor
from server.security.principal import Principal
from server.store.records import CollectionRecord, FrameExtent
from server.store.storage import ReadTransaction, Storage

ROOT: Final = "/ogc"
CONFORMANCE: Final = (
    "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/core",
    "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/geojson",
)
_CRS84: Final = "http://www.opengis.net/def/crs/OGC/1.3/CRS84"
_KINDS: Final[tuple[FeatureKind, ...]] = ("landmarks", "submaps")
_ABOUT: Final[dict[FeatureKind, str]] = {
    "landmarks": "Trees as points, with diameter, height and species. A tree that several submaps of a stand share is "
    "one feature.",
    "submaps": "Submaps as the outlines of their trees.",
}


def landing_page(base: str) -> dict[str, Any]:
    """The landing page. `base` is the address of the service, without a slash at the end."""
    return {
        "title": "Urquhart",
        "description": "Trees and submaps of a place-recognition database for forests.",
        "links": [
            _link(f"{base}{ROOT}", "self", "application/json", "This page"),
            _link(f"{base}/openapi.json", "service-desc", "application/vnd.oai.openapi+json;version=3.1", "The API"),
            _link(f"{base}/docs", "service-doc", "text/html", "The API, for people"),
            _link(f"{base}{ROOT}/conformance", "conformance", "application/json", "Conformance classes"),
            _link(f"{base}{ROOT}/collections", "data", "application/json", "Feature collections"),
        ],
    }


def list_page(database: Storage, limits: Limits, caller: Principal, base: str, cursor: str | None) -> dict[str, Any]:
    """The feature collections of all collections that the caller may see, oldest first.

    Beyond the largest page, a link leads to the next. Raises InvalidField.
    """
    size = limits.page_max
    with database.read() as tx:
        rows = tx.collections.page(caller.patterns, after_key=read_cursor("collections", cursor), limit=size + 1)
        described = [one for row in rows[:size] for one in _described(tx, row, base, _KINDS)]
    links = [_link(f"{base}{ROOT}/collections", "self", "application/json", "This page")]
    if len(rows) > size:
        following = f"{base}{ROOT}/collections?cursor={write_cursor('collections', rows[size - 1].key)}"
        links.append(_link(following, "next", "application/json", "The next page"))
    return {"links": links, "collections": described}


def describe(database: Storage, collection_id: str, kind: FeatureKind, base: str) -> dict[str, Any]:
    """One feature collection. Raises NotFound."""
    with database.read() as tx:
        [found] = _described(tx, get_collection(tx, collection_id), base, (kind,))
    return found


def source_of(database: Storage, collection_id: str, kind: FeatureKind) -> ItemSource:
    """What the features of a feature collection are made of. Raises NotFound."""
    with database.read() as tx:
        collection = get_collection(tx, collection_id)
        extents = tx.collections.extents(collection.key)
        systems = frame_systems(tx, collection, [extent.frame_id for extent in extents])
    return ItemSource(database, kind, ExportPlaces(collection, systems, DEGREES), tuple(extents))


def path_of(collection_id: str, kind: FeatureKind) -> str:
    """Path of a feature collection."""
    return f"{ROOT}/collections/{quote(collection_id, safe='')}:{kind}"


def item_links(base: str, path: str, feature_id: str) -> list[dict[str, str]]:
    """The links of a feature."""
    return [
        _link(f"{base}{path}/items/{quote(feature_id, safe='')}", "self", "application/geo+json", "This feature"),
        _link(f"{base}{path}", "collection", "application/json", "Its feature collection"),
    ]


def page_links(base: str, path: str, query: str, following: str | None) -> list[dict[str, str]]:
    """The links of a page of features. `query` is the query of the request, `following` that of the next page."""
    own = f"{base}{path}/items{f'?{query}' if query else ''}"
    links = [
        _link(own, "self", "application/geo+json", "This page"),
        _link(f"{base}{path}", "collection", "application/json", "The feature collection"),
    ]
    if following is not None:
        links.append(_link(f"{base}{path}/items?{following}", "next", "application/geo+json", "The next page"))
    return links


def _described(
    tx: ReadTransaction, row: CollectionRecord, base: str, kinds: Sequence[FeatureKind]
) -> list[dict[str, Any]]:
    extents = tx.collections.extents(row.key)
    box, unplaced = _covered(tx, row, extents)
    found = []
    for kind in kinds:
        path = path_of(row.id, kind)
        about = _ABOUT[kind]
        if unplaced:
            names = ", ".join(map(repr, unplaced[:5])) + (" ..." if len(unplaced) > 5 else "")
            about += (
                f" Those in the map frames {names} have no geometry, because these have no coordinate reference system."
            )
        one: dict[str, Any] = {
            "id": f"{row.id}:{kind}",
            "title": f"{row.title or row.id}: {kind}",
            "description": about,
            "itemType": "feature",
            "crs": [_CRS84],
            "links": [
                _link(f"{base}{path}", "self", "application/json", "This feature collection"),
                _link(f"{base}{path}/items", "items", "application/geo+json", "Its features"),
            ],
        }
        if box is not None:
            one["extent"] = {"spatial": {"bbox": [list(box)], "crs": _CRS84}}
        found.append(one)
    return found


def _covered(
    tx: ReadTransaction, row: CollectionRecord, extents: Sequence[FrameExtent]
) -> tuple[tuple[float, float, float, float] | None, list[str]]:
    """What the map frames cover, in degrees, None if that is not known; and those that have no system."""
    systems = frame_systems(tx, row, [extent.frame_id for extent in extents])
    boxes = [box for one in extents if (box := degrees_of(systems[one.frame_id], one)) is not None]
    unplaced = [one.frame_id for one in extents if systems[one.frame_id].crs is None]
    if not boxes:
        return None, unplaced
    # A box that crosses 180 degrees has its west in the east.
    boxes = [one if one[0] <= one[2] else (-180.0, one[1], 180.0, one[3]) for one in boxes]
    west, south, east, north = zip(*boxes, strict=True)
    return (min(west), min(south), max(east), max(north)), unplaced


def _link(href: str, rel: str, media_type: str, title: str) -> dict[str, str]:
    return {"href": href, "rel": rel, "type": media_type, "title": title}
