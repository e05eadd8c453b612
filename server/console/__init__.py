"""The console: the built files of the single-page app in `ui/`, which the wheel carries."""
