"""Define the rules that `mapmore check` applies to a spec and its data. Every run applies these
rules, too.
"""
