"""Implement the method and its competitors on arrays, without files."""
