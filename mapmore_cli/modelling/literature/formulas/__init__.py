"""One module for each formula of the literature, with its `FORMULA`."""
