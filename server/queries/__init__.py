"""Where is this? A question narrowed, looked up, answered, kept."""
