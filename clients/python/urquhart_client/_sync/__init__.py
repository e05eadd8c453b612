"""The blocking client, in parts; `_async` is made of it by `mirror.py`."""
