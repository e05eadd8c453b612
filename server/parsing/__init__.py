"""JSON as callers send it: read strictly, and its errors as JSON pointers with advice.

Used for request bodies and for lines of imports. Imports `errors` only.
"""
