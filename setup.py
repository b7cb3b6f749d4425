"""What pyproject.toml cannot say: the wheel tells its parts (PEP 770), as CycloneDX JSON in `.dist-info/sboms`."""

import json
import re
import tomllib
from pathlib import Path

from setuptools import setup
from setuptools.command.bdist_wheel import bdist_wheel

HERE = Path(__file__).parent


def bill_of_materials(version: str) -> dict[str, object]:
    """The program and the libraries that it is installed with, in the versions that it was tested with; the wheel holds none of them."""
    project = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = (HERE / "constraints.txt").read_text(encoding="utf-8").splitlines()
    tested = {_plain(name): number for name, mark, number in (line.partition("==") for line in lines) if mark}
    extras = [line for name, wanted in project["optional-dependencies"].items() if name != "dev" for line in wanted]
    components = [
        _component(_plain(re.split(r"[<>=!~ ]", line)[0]), tested, "optional" if line in extras else "required")
        for line in [*project["dependencies"], *extras]
    ]
    own = {"type": "application", "name": project["name"], "version": version, "bom-ref": f"pkg:pypi/{project['name']}@{version}"}
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {"component": own | {"purl": own["bom-ref"], "licenses": [{"license": {"id": project["license"]}}]}},
        "components": components,
        "dependencies": [{"ref": own["bom-ref"], "dependsOn": [component["bom-ref"] for component in components]}],
    }


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _component(name: str, tested: dict[str, str], scope: str) -> dict[str, str]:
    purl = f"pkg:pypi/{name}@{tested[name]}"
    return {"type": "library", "name": name, "version": tested[name], "bom-ref": purl, "purl": purl, "scope": scope}


class WithParts(bdist_wheel):
    """A wheel with its bill of materials."""

    def egg2dist(self, egginfo_path: str, distinfo_path: str) -> None:
        """Add it to the folder of metadata."""
        super().egg2dist(egginfo_path, distinfo_path)
        folder = Path(distinfo_path) / "sboms"
        folder.mkdir()
        document = bill_of_materials(self.distribution.get_version())
        (folder / "mapmore.cdx.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


setup(cmdclass={"bdist_wheel": WithParts})
