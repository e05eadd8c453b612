"""All SQL: the tables, the database and its transactions, the repositories, the schema's versions."""
