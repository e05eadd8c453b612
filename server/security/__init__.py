"""Who calls, and what the caller may do: API keys, scopes, rate limits.

No HTTP: `http.authorization` applies it to requests. Imports `store`, `config` and `errors`.
"""
