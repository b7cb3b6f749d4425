"""Implement MAPMORE and its competitors for arrays, without reading or writing files."""
