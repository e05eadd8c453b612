"""Verification: the evidence for a transform between two submaps, from all of their landmarks.

May import the ground floor and `features`.
"""
