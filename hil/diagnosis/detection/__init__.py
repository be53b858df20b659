"""The search for causes: screen, contest, laws in no list, what is beyond doubt."""
