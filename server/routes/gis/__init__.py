"""Routes for GIS: files, and features as QGIS and GDAL read them from a running service."""
