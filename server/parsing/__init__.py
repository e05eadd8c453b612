"""JSON from callers: read strictly, with errors as JSON pointers and advice.

Used for request bodies and for lines of imports. Imports `errors` only.
"""
