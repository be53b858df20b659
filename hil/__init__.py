"""Takes a controller and a vehicle and gives a bench to test them on, and evidence from logs.

Four subjects: run a bench (`rt`, `bus`, `faults`, `scenario`, `bench`), handle logs (`log`, `report`), explain data
(the diagnosis, `identify`), validate the project (`validation`). `doctor` examines the machine, `cli` and
`pytest_plugin` are the faces.
"""
