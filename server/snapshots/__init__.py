"""Copies of the whole database: made, kept, put back."""
