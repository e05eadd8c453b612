"""What Prometheus sees: counted here, read from the database, put together from several processes."""
