"""Reports for people: explanations of an answer, in words and as pictures.

May import every room below.
"""
