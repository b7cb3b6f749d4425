"""Frozen types that pass between the layers, and the errors that users see."""

THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""What libraries ask for the number of their threads when they start."""
