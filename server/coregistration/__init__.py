"""Coregistration: the plots of a season placed in a map, with tables, transforms, pictures and a report.

Used by `urquhart coregister`.
"""
