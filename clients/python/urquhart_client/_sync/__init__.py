"""The blocking client. `generate_async.py` generates `_async` from it."""
