"""One Report value and its printers."""
