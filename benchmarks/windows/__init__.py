"""Searches within a prior's window: what they find, what they must not find, and the fit of their confidence."""
