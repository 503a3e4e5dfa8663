"""What a release is described by agrees: project, citation, archive, recipe, workflows."""

import json
import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
# Names of conda where they are others.
CONDA = {"matplotlib": "matplotlib-base"}


def read(path):
    """A file of YAML or JSON."""
    return yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))


def test_citation_names_the_software_first_and_the_paper_as_a_reference():
    cited = read("CITATION.cff")
    assert cited["type"] == "software"
    assert "preferred-citation" not in cited  # it would stand before the software
    (paper,) = cited["references"]
    assert (paper["type"], paper["title"]) == (
        "article",
        "Myosin-independent amoeboid cell motility",
    )
    assert "version" not in cited  # which is that of the tag


def test_citation_archive_and_project_agree():
    cited, archived = read("CITATION.cff"), json.loads((ROOT / ".zenodo.json").read_text())
    assert archived["title"] == cited["title"]
    assert [c["name"] for c in archived["creators"]] == [a["name"] for a in cited["authors"]]
    assert [a["name"] for a in PROJECT["authors"]] == [a["name"] for a in cited["authors"]]
    assert archived["license"] == cited["license"] == PROJECT["license"]
    assert archived["keywords"] == cited["keywords"] == PROJECT["keywords"]


def test_recipe_has_the_dependencies_of_the_project():
    recipe = read("recipe/recipe.yaml")
    needed = PROJECT["dependencies"] + [
        text for extra in ("surface", "plot", "units", "data") for text in EXTRAS[extra]
    ]
    assert sorted(recipe["requirements"]["run"]) == sorted(
        [f"python {PROJECT['requires-python']}", *map(in_conda, needed)]
    )
    others = {"vtk", "dask", "posterior", "movie", "explore", "gpu"}
    optional = [text for extra in others for text in EXTRAS[extra] if "amoeboid[" not in text]
    assert sorted(recipe["requirements"]["run_constraints"]) == sorted(map(in_conda, optional))
    host = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    assert {in_conda(text) for text in host[:2]} <= set(recipe["requirements"]["host"])


def in_conda(requirement):
    """A requirement as a recipe has it: "pillow>=10.1" as "pillow >=10.1"."""
    name, least = requirement.split(">=")
    return f"{CONDA.get(name, name)} >={least}"


def test_every_workflow_tests_the_pythons_of_the_project():
    named = [text.rpartition(" ")[2] for text in PROJECT["classifiers"] if ":: 3." in text]
    tests = read(".github/workflows/tests.yml")["jobs"]["tests"]["strategy"]["matrix"]
    assert tests["python"] == named
    assert {name.partition("-")[0] for name in tests["os"]} == {"ubuntu", "macos", "windows"}
    built = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["cibuildwheel"]["build"]
    assert built.split() == [f"cp{name.replace('.', '')}-*" for name in named]


@pytest.mark.parametrize(
    "path", sorted(p.relative_to(ROOT).as_posix() for p in (ROOT / ".github").rglob("*.yml"))
)
def test_workflows_are_yaml_and_keep_no_secret(path):
    text = (ROOT / path).read_text(encoding="utf-8")
    found = yaml.safe_load(text)
    assert found
    assert "secrets." not in text  # releases are published without a password
    if "jobs" in found:
        assert "permissions" in found
        assert all("runs-on" in job for job in found["jobs"].values())


def test_references_of_the_joss_paper_are_cited_and_defined():
    paper = (ROOT / "joss/paper.md").read_text(encoding="utf-8")
    defined = set(re.findall(r"@\w+\{(\w+),", (ROOT / "joss/paper.bib").read_text()))
    body = paper.split("---", 2)[2]
    assert set(re.findall(r"@(\w+)", body)) == defined
    assert 750 <= len(re.findall(r"\w[\w'-]*", body)) <= 1750
    sections = re.findall(r"^# (.+)$", body, flags=re.MULTILINE)
    assert sections == [
        "Summary", "Statement of need", "State of the field", "Software design",
        "Research impact statement", "AI usage disclosure", "Acknowledgements", "References",
    ]  # fmt: skip
