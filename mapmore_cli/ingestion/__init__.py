"""From files to curves: what the ingest stage does, step by step."""
