"""Simulated forests and observations, and scores of a method's answers.

May import the ground floor and `features`.
"""
