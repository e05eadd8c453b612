"""The awaiting client, in parts; `_async` is made by `mirror.py`."""
