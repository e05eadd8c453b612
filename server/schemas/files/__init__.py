"""Answers about files: what a coregistration writes, plot by plot and file by file."""
