"""ASAM MDF 4: bus logs read and written, decoded signals written."""
