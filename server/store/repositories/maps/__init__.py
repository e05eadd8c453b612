"""Rows of what maps are made from."""
