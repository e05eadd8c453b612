"""Requests about stands and files of trees; see `requests`."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from urquhart_client._protocol.exchange import M, Request, model, nothing, page
from urquhart_client._protocol.requests import collection_path, conditional, once, parameters, segment, with_body
from urquhart_client.models import Page
from urquhart_client.stand_models import Stand, StandReceipt
from urquhart_client.stem_maps import FileTrees


def get_stands(collection: str, limit: int | None, cursor: str | None) -> Request[Page[Stand]]:
    """A page of stands."""
    path = f"{collection_path(collection)}/stands"
    return Request("GET", path, page("stands", Stand), params=parameters(limit=limit, cursor=cursor))


def get_stand(collection: str, name: str) -> Request[Stand]:
    """One stand."""
    return Request("GET", _stand(collection, name), model(Stand))


def delete_stand(collection: str, name: str, if_match: str | None) -> Request[None]:
    """Delete a stand with its submaps."""
    return conditional(Request("DELETE", _stand(collection, name), nothing, headers=once()), if_match, None)


def patch_stand(collection: str, name: str, if_match: str | None, move: Mapping[str, Any]) -> Request[Stand]:
    """Move a stand."""
    sent = with_body("PATCH", _stand(collection, name), move, model(Stand), once())
    return conditional(sent, if_match, None)


def read_stem_map(path: Path, options: Mapping[str, Any]) -> Request[FileTrees]:
    """Read a file of trees."""
    return _sent("POST", "/v1/stem-maps", path, FileTrees, options)


def put_stand(
    collection: str, name: str, path: Path, if_match: str | None, cutting: Mapping[str, Any]
) -> Request[StandReceipt]:
    """Store a file of trees as a stand."""
    sent = _sent("PUT", _stand(collection, name), path, StandReceipt, cutting)
    return conditional(replace(sent, headers={**sent.headers, **once()}), if_match, None)


def _sent(method: str, url: str, path: Path, kind: type[M], options: Mapping[str, Any]) -> Request[M]:
    """A request with the bytes of a file, which may be sent again."""
    given = {name: value for name, value in options.items() if value not in (None, False, "")}
    known = {name: "true" if value is True else value for name, value in given.items()}
    return Request(
        method,
        url,
        model(kind),
        params=parameters(file=path.name, **known),
        headers={"Content-Type": "application/octet-stream"},
        content=path.read_bytes(),
        harmless=True,
    )


def _stand(collection: str, name: str) -> str:
    return f"{collection_path(collection)}/stands/{segment(name, 'stand')}"
