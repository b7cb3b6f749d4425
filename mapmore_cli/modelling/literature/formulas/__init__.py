"""Define the formulas of the literature, one module with a `FORMULA` or `FORMULAS` for each."""
