"""The edge to HTTP: everything that knows requests, responses and media types, but no route."""
