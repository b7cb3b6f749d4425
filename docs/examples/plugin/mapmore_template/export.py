"""The equations of a model as JSON: `mapmore export model.h5 --to json`."""

import json
from typing import Any

from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.kinds import equations


def equations_as_json(model: Model, _wanted: Any) -> dict[str, str]:
    """Return one file, by its name. A later export replaces it, because it contains `mapmore`."""
    equations_by_id = {one.id: one.text for one in equations(model)}
    document = {"creator": "mapmore", "equations": equations_by_id}
    return {f"{model.name}.json": json.dumps(document, indent=1) + "\n"}
