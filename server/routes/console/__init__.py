"""Routes of the console: its files, and its sessions. They are no part of the API's document."""
