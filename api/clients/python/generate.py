"""Writes the types of the service's answers, src/meniscus_client/models.py, from its OpenAPI document.

    python generate.py openapi.json src/meniscus_client/models.py
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

#: Bodies are dictionaries, which the service judges; their schemas are long.
BODIES = ("Spec", "Scene")


def answers(document: dict) -> dict:
    """The document with the schemas of answers alone."""
    schemas = document["components"]["schemas"]
    kept = {name: schema for name, schema in schemas.items() if not name.endswith(BODIES)}
    return {**document, "paths": {}, "components": {"schemas": kept}}


def main(source: str, target: str) -> None:
    document = answers(json.loads(Path(source).read_text()))
    with tempfile.TemporaryDirectory() as place:
        filtered = Path(place, "answers.json")
        filtered.write_text(json.dumps(document))
        subprocess.run(
            [
                sys.executable, "-m", "datamodel_code_generator", "--input", filtered, "--input-file-type", "openapi", "--output", target,
                "--output-model-type", "typing.TypedDict", "--target-python-version", "3.11", "--use-standard-collections",
                "--use-union-operator", "--use-schema-description", "--disable-timestamp", "--enum-field-as-literal", "all", "--formatters", "builtin",
                "--custom-file-header", '"""Types of the answers of the service, written by generate.py."""',
            ],
            check=True,
        )


if __name__ == "__main__":
    main(*sys.argv[1:])
