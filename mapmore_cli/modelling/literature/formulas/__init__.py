"""Contain the formulas of the literature. Every module defines one formula (`FORMULA`) or several
similar formulas (`FORMULAS`).
"""
