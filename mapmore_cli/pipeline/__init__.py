"""Run the stages of a study. Decide which stages are out of date, and run other runs first if they
are needed.
"""
