"""Piecewise state-space models of motion (P): linear sections of second order along an input, such as a regulator's voltage.

`sections` knows the plane of the poles, and which section holds at a sample; `simulation` runs a model; `problem` is the error of one
section, `solvers` find its least; `fitting` puts it all together, and joins sections that share a state.
"""
