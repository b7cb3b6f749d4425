"""The five papers beside the shipped studies: one module a paper, `page.py` puts them together."""
