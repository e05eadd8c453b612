"""Pages of lists whose entries are summaries of larger documents."""
