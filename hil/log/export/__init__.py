"""Decoded signals as files: CSV, Parquet, MF4."""
