"""Security: API keys, scopes, rate limits.

No HTTP: `http.authorization` applies it to requests. Imports `store`, `config` and `errors`.
"""
