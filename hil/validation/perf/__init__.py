"""Takes a subject and gives paired measurements of its speed: us against a peer or a limit, in one run."""
