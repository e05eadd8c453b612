"""The awaiting client. `mirror.py` generates it from `_sync`."""
