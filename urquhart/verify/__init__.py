"""Whether one transform between two submaps is right, judged by all of their landmarks.

May import the ground floor and `features`.
"""
