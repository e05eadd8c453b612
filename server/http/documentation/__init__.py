"""Documentation that the service generates: OpenAPI document, API reference, HTML pages, published limits.

Imports `http.admission`, `http` and below.
"""
