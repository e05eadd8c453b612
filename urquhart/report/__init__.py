"""Answers for people: why an answer is what it is, in words and as pictures.

May import every room below.
"""
