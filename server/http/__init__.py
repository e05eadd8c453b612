"""HTTP without routes: authorization, bodies, media types, headers, problem documents, middleware.

Imports `security`, `resources`, `schemas`, `observability` and below.
"""
