"""Takes what the code declares and gives the generated pages and figures of the documents."""
