"""Text formats: a compiled pass over the plain lines, a careful parser for all others; written by compiled passes."""
