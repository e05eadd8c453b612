"""The paper's own chain (matching, RANSAC) and the two methods it compares itself with, written from their papers.

May import the ground floor, `features`, and `index`.
"""
