"""Models with memory: delays, slow states, hysteresis operators and resonances as candidates of one regression."""
