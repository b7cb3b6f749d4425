"""The pipeline: ingest, segment, fit, fuse, validate, report."""
