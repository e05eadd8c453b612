"""What can be proven of a database."""
