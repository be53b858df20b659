"""Paired measurements of speed: us against a peer or a limit, in one run."""
