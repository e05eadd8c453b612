"""HTML pages for people: the landing page, and explanations of problems."""

from html import escape
from typing import Any

from server.platform.version import service_version
from server.schemas.collections import CollectionPage, CollectionSummary

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

_CALLS = """\
B=@BASE@
# 1. a collection
curl -X PUT $B/v1/collections/plots -H 'Content-Type: application/json' -d '{}'
# 2. a submap: the trees of a plot, metres, in a frame of its own
curl -X PUT $B/v1/collections/plots/submaps/p7 -H 'Content-Type: application/json' -d '{"xy": [[1.2, 3.4], ...]}'
# 3. where was this seen?
curl -X POST $B/v1/collections/plots/queries -H 'Content-Type: application/json' \\
     -d '{"xy": [[0.4, 2.9], ...], "limit": 5, "store": true}'
# 4. the match, drawn
curl $B/v1/collections/plots/queries/1/candidates/1/match -H 'Accept: image/svg+xml' -o match.svg
# 5. what is stored
curl $B/v1/collections/plots/submaps"""


def landing_html(page: CollectionPage, docs: str, base_url: str) -> str:
    """The landing page. `base_url` is the address under which the caller reached the service."""
    if page.collections:
        rows = "\n".join(_row(collection) for collection in page.collections)
        table = (
            "<table><thead><tr><th>Collection</th><th>Title</th><th class=n>Submaps</th><th class=n>Trees</th>"
            f"<th class=n>Revision</th></tr></thead><tbody>{rows}</tbody></table>"
        )
        if page.next is not None:
            table += '<p><a href="/v1/collections">All collections</a></p>'
    else:
        table = "<p>None yet: the first call below makes one.</p>"
    links = "".join(f'<a href="{escape(url)}">{escape(name)}</a>' for name, url in _links(docs).items())
    return _document(
        "Urquhart",
        f"""<h1>Urquhart</h1>
<p class=lead>Place recognition for forests: tree positions in, a verified pose out.</p>
<nav>{links}</nav>
<h2>Collections</h2>
{table}
<h2>In five calls</h2>
<pre>{escape(_CALLS.replace("@BASE@", base_url))}</pre>
<p>A query answers <code>matched</code>, <code>ambiguous</code> or <code>no_match</code>, with the transform
<code>submap_T_query</code> (metres, radians, counter-clockwise), its covariance and the pairs of trees
that prove it.</p>""",
    )


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


def _row(collection: CollectionSummary) -> str:
    return (
        f'<tr><td><a href="{escape(collection.links.self)}">{escape(collection.id)}</a></td>'
        f"<td>{escape(collection.title or '')}</td>"
        f'<td class=n><a href="{escape(collection.links.submaps)}">{collection.counts.submaps:,}</a></td>'
        f"<td class=n>{collection.counts.landmarks:,}</td><td class=n>{collection.revision:,}</td></tr>"
    )


def _links(docs: str) -> dict[str, str]:
    return {
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
