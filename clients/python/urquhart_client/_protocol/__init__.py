"""The client without I/O: requests, answers, retries, files, connection pools.

Both shells, `_sync` and `_async`, call it. Imports only models and errors.
"""
