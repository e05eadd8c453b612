"""Other ways to find submaps worth verifying. What they find is verified as ours is: only the search differs."""
