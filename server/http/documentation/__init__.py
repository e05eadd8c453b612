"""What the service says of itself: OpenAPI document, API reference, HTML pages, published limits.

Imports `http.admission`, `http` and below.
"""
