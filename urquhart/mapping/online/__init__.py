"""Poses of a pose graph that grows while a robot drives, brought up to date with what is new.

Imports `mapping` and below.
"""
