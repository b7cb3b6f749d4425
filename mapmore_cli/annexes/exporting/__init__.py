"""Write models in other languages: C, FMU, Python, LaTeX, tables."""
