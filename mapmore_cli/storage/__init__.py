"""Files: readers of recordings, HDF5 artefacts, atomic writes, hashes, provenance."""
