"""Read and write files: readers of recordings, HDF5 result files, atomic writes, hashes,
provenance.
"""
