"""Requests about stands; see `requests`."""

from urquhart_client._protocol.exchange import Request, model, nothing, page
from urquhart_client._protocol.requests import collection_path, conditional, once, parameters, segment
from urquhart_client.models import Page
from urquhart_client.stand_models import Stand


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


def _stand(collection: str, name: str) -> str:
    return f"{collection_path(collection)}/stands/{segment(name, 'stand')}"
