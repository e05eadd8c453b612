"""JSON bodies of requests and answers, as pydantic models: one module per resource.

The wire format, and nothing else. Imports `parsing` and the words of `urquhart`.
"""
