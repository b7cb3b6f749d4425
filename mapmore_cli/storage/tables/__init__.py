"""Tables of numbers out of files: what the readers of all formats share."""
