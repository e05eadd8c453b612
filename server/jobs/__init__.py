"""Long work: rows that outlive processes, files beside the database, and a thread that does it."""
