"""Takes frames of the sensors and gives demands to brakes and motors: the controller. No I/O in here."""
