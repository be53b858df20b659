"""Signals of logs as whole columns, and what differs between two logs."""
