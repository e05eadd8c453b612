"""What coregistration writes: tables, layers, transforms, pictures, and the report."""
