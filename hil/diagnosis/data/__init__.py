"""Log files in, a dataset out.

`read` makes one table of SI channels (`log.Log`) of each file; `prepare` puts the tables on the 10 ms grid (`grid`),
cuts them into segments and marks where they are compared (`masks`): `dataset.Dataset`, one `Recording` per log.
"""
