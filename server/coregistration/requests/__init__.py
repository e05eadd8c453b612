"""What callers ask for when they place a season, the same from the command line and over REST."""
