"""Log files: guarded reading, vectorised decoding, export."""
