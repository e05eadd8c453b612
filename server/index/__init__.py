"""The index of each collection: caught up before it is used, written to segments, merged, checked."""
