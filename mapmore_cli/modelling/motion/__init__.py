"""Piecewise state-space models of motion (P): linear sections of second order along an input, such as a regulator's voltage."""
