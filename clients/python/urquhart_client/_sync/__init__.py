"""The blocking client. `mirror.py` generates `_async` from it."""
