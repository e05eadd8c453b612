"""Queries: filters, search, answer, explanation, and stored answers.

Imports `submaps`, `index` and below.
"""
