"""Models as assignments of one sample's numbers: what becomes C or a module of NumPy, and what derivatives follow from."""
