"""MAPMORE: piecewise models of soft actuators from measured curves."""
