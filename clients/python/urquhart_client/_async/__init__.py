"""The awaiting client. `generate_async.py` generates it from `_sync`."""
