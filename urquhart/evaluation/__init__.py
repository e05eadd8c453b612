"""Simulated forests and observations, and the scores of what a method answers to them.

May import the ground floor and `features`.
"""
