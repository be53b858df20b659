"""Isolation: takes the information matrix and a named cause, gives its rivals and the manoeuvres that decide."""
