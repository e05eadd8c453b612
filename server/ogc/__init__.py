"""Collections as feature collections of OGC API - Features (Part 1: Core, 1.0), which a GIS reads from the service."""
