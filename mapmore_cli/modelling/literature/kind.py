"""A formula of the literature as the whole model."""

from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import Formula
from mapmore_cli.modelling.kinds import Kind

KIND = Kind("formula", Formula, FormulaFit, "literature")
