"""Takes one `Report` value and gives it as a page, a figure or text."""
