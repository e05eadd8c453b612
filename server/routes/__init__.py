"""One resource each: what is asked, who does it, how it is answered. No SQL, no numpy."""
