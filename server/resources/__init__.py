"""What all resources share: paths, pages of lists, preconditions, idempotent writes.

Imports `store`, `config` and `errors`; knows no particular resource.
"""
