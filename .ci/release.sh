#!/usr/bin/env bash
# What a release has to pass: `make release-check [PYTHONS="python3.12"]`.
# The sources of a fresh clone are built into an archive and a wheel without a network, and twine looks at both. Then five visitors come:
# to the wheel alone, far from any checkout, on each Python that is here, and to the clone. No command of theirs may open a connection.
set -euo pipefail
project=$(cd "$(dirname "$0")/.." && pwd)
python=$project/.venv/bin/python
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir "$folder/offline" "$folder/dist"
PYTHONPATH=$project/tests "$python" -c "import common; print(common.NO_NETWORK)" > "$folder/offline/sitecustomize.py"

build() {  # WHAT: what pip has the build backend do in this folder, without pip and without a network
  PYTHONPATH=$folder/offline "$python" -c "from setuptools import build_meta; build_meta.build_$1('$folder/dist')" > "$folder/log" || { cat "$folder/log"; exit 1; }
}

visit() {  # PROGRAMS FOLDER: what the visitors type, one after the other
  mkdir "$2" && cd "$2"
  export PATH=$1:$PATH PYTHONPATH=$folder/offline
  set -x
  : student
  mapmore example muscle -q
  mapmore check muscle/study.yaml -q
  mapmore run muscle/study.yaml -q
  mapmore show runs/example/model.h5
  mapmore run muscle/search.yaml -q
  mapmore init muscle --name mine -o mine.yaml --yes -q
  mapmore run mine.yaml -q
  : controls engineer
  mapmore export runs/example/model.h5 --to c -o controller
  mapmore export runs/example/model.h5 --to py -o controller
  mapmore export runs/example/model.h5 --to table -o tables
  mapmore predict runs/example/model.h5 --grid pressure=80:500:140,strain=0:0.1:0.05 -o table.csv
  : engineer of CI
  mapmore run muscle/study.yaml --json -q --junit junit.xml --summary summary.md
  mapmore freeze example --tag spring
  mapmore compare spring example --fail-on 0.03
  mapmore batch muscle/study.yaml muscle/search.yaml -q
  : reviewer
  mapmore figure example fit --curve 350 -o fig.pdf --data fig.csv
  mapmore tune muscle/study.yaml --over segment.strain.count=2,4 -q
  : notebook
  python -c "import mapmore_cli as mm; assert mm.load_model('runs/example/model.h5')(pressure=200, strain=0.05) > 0; mm.run('muscle/study.yaml').scores"
  ls runs/{example,example-search,mine}/report/index.html controller/example.{c,py} tables/example.mat junit.xml summary.md fig.pdf
  { set +x; } 2> /dev/null
}

git clone --quiet "$project" "$folder/clone"
cd "$folder/clone" && build sdist
tar -xzf "$folder"/dist/*.tar.gz -C "$folder"
cd "$folder"/mapmore-*/ && build wheel
"$python" -m twine check --strict "$folder"/dist/*
for version in ${*:-python3.11 python3.12 python3.13}; do
  found=$(ls -d "${PYENV_ROOT:-$HOME/.pyenv}/versions/${version#python}"*/bin/python 2> /dev/null | tail -1 || true)
  found=${found:-$(command -v "$version" || true)}
  if test -z "$found"; then echo "there is no $version here: left out"; continue; fi
  "$found" -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --disable-pip-version-check "$folder"/dist/*.whl
  (visit "$folder/$version/bin" "$folder/visit-$version") > "$folder/log" || { cat "$folder/log"; exit 1; }
  echo "$version: the wheel alone passes"
done
make -C "$folder/clone" demo PYTHON="$python"
(visit "$folder/clone/.venv/bin" "$folder/visit-clone") > "$folder/log" || { cat "$folder/log"; exit 1; }
echo "the release passes"
