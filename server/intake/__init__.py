"""Submaps on their way in: prepared, described, stored, one by one and by the thousand."""
