"""Files of trees as tables: text, spreadsheets, GIS files and point clouds, before anybody says what a column means."""
