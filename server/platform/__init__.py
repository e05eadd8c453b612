"""What the operating system provides: processes, threads, file locks, random ids.

Knows nothing of submaps, SQL or HTTP. Imports `errors` only.
"""
