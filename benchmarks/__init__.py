"""What the project's figures are measured with. `python -m benchmarks` prints the everyday ones."""
