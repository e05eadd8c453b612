"""The two methods that the paper compares itself with, written from their papers."""
