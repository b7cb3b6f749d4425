"""Piecewise state-space models of motion (P): linear sections of second order along an input, such as a regulator's voltage.

`regimes` says which section holds at a sample; `simulation` runs a model; `plane` knows the poles; `problem` is the error of one section,
`solvers/` find its least; `bumpless` joins sections that share a state; `fitting` puts it all together. A further solver is a further file.
"""
