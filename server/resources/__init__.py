"""What every resource shares: its path, pages of a listing, preconditions, writes that are safe to repeat.

Imports `store`, `config` and `errors`; knows no particular resource.
"""
