"""Recordings made by the synthetic rigs."""
