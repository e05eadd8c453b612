"""Where is this? Filters, search, answer, explanation, and answers that are kept.

Imports `submaps`, `index` and below.
"""
