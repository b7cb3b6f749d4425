"""Models with memory: delayed quantities, slow states, hysteresis operators and resonances as candidates of one regression.

A state is a name (`terms.states`): `force[k-1]`, `slow(play(pressure, 0.16), 0.3)`. `families` writes such names, and the products that
make a dictionary; `resolution` finds the numbers behind them in training; `evaluation` computes them along a piece of a recording;
`fitting` selects terms and fits them; `free_run` simulates.
"""
