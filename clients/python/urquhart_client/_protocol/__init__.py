"""The client without I/O: requests built, answers read, retries decided, files and pools kept.

Both shells, `_sync` and `_async`, call it. Imports the models and errors only.
"""
