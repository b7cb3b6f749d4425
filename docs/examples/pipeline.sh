#!/usr/bin/env bash
# SPEC TABLE: bring the study up to date, say how it compares with Sárosi's formula, and predict a table to stdout.
set -euo pipefail
spec=$1 table=$2
runs=${RUNS:-runs}

document=$(mapmore run "$spec" --runs "$runs" --json --quiet)
printf '%s' "$document" | python3 -c '
import json, sys
rows = {row["model"]: row["nrmse"] for row in json.load(sys.stdin)["scores"] if (row["split"], row["curve"]) == ("validate", "all")}
better = rows["mapmore"] < rows["sarosi"]
print("mapmore", "beats" if better else "does not beat", "sarosi:", *(f"{100 * rows[name]:.2f} %" for name in ("mapmore", "sarosi")), file=sys.stderr)
'
name=$(printf '%s' "$document" | python3 -c 'import json, sys; print(json.load(sys.stdin)["name"])')
mapmore predict "$runs/$name/model.h5" - < "$table"
