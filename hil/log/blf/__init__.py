"""Vector's binary logging format (BLF): read and written."""
