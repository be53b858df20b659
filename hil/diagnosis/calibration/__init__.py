"""A vehicle set fitted to reference logs.

`calibrate.calibrate` fits, `fitted_set` says which keys get which value and tolerance, `write` makes it TOML and text.
"""
