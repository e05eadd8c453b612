"""Pages beside the API: the landing page for programs, and explanations of problems for people."""

from html import escape
from typing import Any

from server.platform.version import service_version
from server.schemas.collections import CollectionPage

_STYLE = """
:root{color-scheme:light dark;--line:#8885;--leaf:#2e7d4f;--soft:#8881}
body{font:16px/1.55 system-ui,sans-serif;max-width:52rem;margin:3rem auto;padding:0 1.2rem}
h1{margin:0;font-size:2rem}h2{margin-top:2.2rem;font-size:1.15rem}.lead{font-size:1.1rem;margin:.4rem 0 1.2rem}
a{color:var(--leaf)}table{border-collapse:collapse;width:100%}
th,td{text-align:left;padding:.4rem .7rem;border-bottom:1px solid var(--line)}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}
pre{background:var(--soft);padding:.9rem 1rem;border-radius:.4rem;overflow-x:auto;font-size:.85rem}
nav a{margin-right:1.1rem}footer{margin-top:3rem;font-size:.85rem;opacity:.7}
"""


def landing_json(page: CollectionPage, docs: str) -> dict[str, Any]:
    """The landing page for programs."""
    return {
        "title": "Urquhart",
        "description": "Place recognition for forests: tree positions in, a verified pose out.",
        "version": service_version(),
        "links": _links(docs),
        "collections": [collection.model_dump(mode="json") for collection in page.collections],
    }


def problem_html(title: str, status: int, about: str) -> str:
    """The explanation of a problem type."""
    body = f"<h1>{escape(title)}</h1><p class=lead>Status {status}</p><p>{escape(about)}</p>"
    return _document(title, f"{body}<p><a href='/'>Urquhart</a></p>")


def _links(docs: str) -> dict[str, str]:
    return {
        "console": "/ui",
        "docs": docs,
        "openapi": "/openapi.json",
        "collections": "/v1/collections",
        "limits": "/v1/limits",
        "ready": "/readyz",
        "metrics": "/metrics",
    }


def _document(title: str, body: str) -> str:
    return (
        f"<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content='width=device-width'>"
        f"<title>{escape(title)}</title><style>{_STYLE}</style>{body}"
        f"<footer>Version {escape(service_version())}</footer></html>"
    )
