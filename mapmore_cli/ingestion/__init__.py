"""Make curves from files: the work of the ingest stage, step by step."""
