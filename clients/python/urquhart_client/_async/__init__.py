"""The awaiting client. `mirror.py` generates `_async` from it."""
