"""The paper's own matching and RANSAC, and the two methods it is compared with, implemented from their papers.

May import the ground floor, `features`, and `index`.
"""
