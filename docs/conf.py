"""The site of the documentation: ``sphinx-build -W docs site``; see docs/decisions/site.md."""

project = "brakebench"
author = "The brakebench developers"
copyright = author
extensions = ["myst_parser"]
myst_heading_anchors = 4
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "brakebench"
html_show_sphinx = False
html_show_copyright = False
html_copy_source = False
highlight_language = "none"  # blocks without a language are what a program prints
