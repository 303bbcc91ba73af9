"""Writes docs/reference from what a service says of itself: a page for each kind of scene, one for the parts of a job that all share, and one
for the requests.

    python reference.py ADDRESS FOLDER
"""

import json
import sys
import urllib.request
from pathlib import Path

MADE = "<!-- Made by `make reference` from what the service says of itself; a test holds it current. -->\n\n"


def get(address: str, path: str) -> dict:
    with urllib.request.urlopen(address + path) as answer:
        return json.load(answer)


def options(schema: dict) -> list[dict]:
    """The alternatives of a schema but null."""
    return [option for option in schema.get("anyOf", schema.get("oneOf", [])) if option.get("type") != "null"]


def unwrap(schema: dict) -> dict:
    """A schema without "or null"."""
    found = options(schema)
    if len(found) != 1:
        return schema
    rest = {name: value for name, value in schema.items() if name not in ("anyOf", "oneOf")}
    return {**unwrap(found[0]), **rest}


def kinds(schema: dict) -> dict[str, dict]:
    """The kinds of a choice, by their `type`."""
    found = {}
    for option in map(unwrap, options(schema)):
        word = option.get("properties", {}).get("type", {}).get("const")
        if word is not None:
            found.setdefault(word, option)
    return found


def interval(schema: dict) -> str:
    parts = []
    for name, sign in [("minimum", "≥"), ("exclusiveMinimum", ">"), ("maximum", "≤"), ("exclusiveMaximum", "<")]:
        if name in schema:
            parts.append(f"{sign} {schema[name]:g}")
    return ", ".join(parts)


def words(schema: dict) -> list[str]:
    if "enum" in schema:
        return [json.dumps(word) for word in schema["enum"]]
    found = [option["const"] for option in options(schema) if "const" in option]
    return [json.dumps(word) for word in found] if len(found) == len(options(schema)) else []


def type_of(schema: dict) -> str:
    """What a value must be, in a few words."""
    schema = unwrap(schema)
    if kinds(schema):
        return "one of the kinds below"
    if words(schema):
        return " or ".join(f"`{word}`" for word in words(schema))
    kind = schema.get("type")
    if kind == "array":
        count = [schema.get("minItems"), schema.get("maxItems")]
        number = f"{count[0]} to {count[1]} " if None not in count and count[0] != count[1] else f"{count[0]} " if count[0] == count[1] and count[0] else ""
        inner = unwrap(schema.get("items", {}))
        of = "numbers" if inner.get("type") == "number" else "lists" if inner.get("type") == "array" else "items"
        return f"list of {number}{of}"
    if kind == "object":
        return "object" if schema.get("properties") else "object of values by name"
    if options(schema):
        return " or ".join(dict.fromkeys(type_of(option) for option in options(schema)))
    said = {"number": "number", "integer": "whole number", "string": "text", "boolean": "`true` or `false`"}.get(kind, "any value")
    return " ".join(part for part in (said, interval(schema)) if part)


def default_of(schema: dict) -> str:
    if "default" not in schema or schema["default"] is None:
        return ""
    default = schema["default"]
    if isinstance(default, dict):
        # The rest has the defaults of its kind.
        word = default.get("type")
        return f'`{{"type": {json.dumps(word)}}}`' if word else "each its own"
    return f"`{json.dumps(default, ensure_ascii=False)}`"


def cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


class Page:
    """A page with a table for each group of parameters; a group that was shown is not shown again."""

    def __init__(self, title: str) -> None:
        self.lines = [f"# {title}\n"]
        self.shown: dict[str, str] = {}

    def group(self, schema: dict, path: str, title: str, level: int) -> None:
        """The parameters of a group, then what lies in them."""
        properties = {name: inner for name, inner in schema.get("properties", {}).items() if "const" not in inner}
        self.lines.append(f"{'#' * min(level, 5)} {title}\n")
        if schema.get("description"):
            self.lines.append(f"{schema['description'][0].upper()}{schema['description'][1:]}.\n")
        if not properties:
            self.lines.append("It has no parameters.\n")
            return
        required = set(schema.get("required", []))
        self.lines.append("| parameter | value | default | meaning |\n| --- | --- | --- | --- |")
        for name, inner in properties.items():
            default = default_of(inner) or ("required" if name in required else "")
            unit = f" ({inner['x-unit']})" if "x-unit" in inner else ""
            self.lines.append(f"| `{name}` | {cell(type_of(inner))}{unit} | {cell(default)} | {cell(inner.get('description', ''))} |")
        self.lines.append("")
        for name, inner in properties.items():
            self.inner(unwrap(inner), f"{path}/{name}", level + 1)

    def inner(self, schema: dict, path: str, level: int) -> None:
        found = kinds(schema)
        if found:
            key = json.dumps({word: sorted(kind.get("properties", {})) for word, kind in found.items()})
            if key in self.shown:
                self.lines.append(f"`{path}` has the kinds of [`{self.shown[key]}`](#{anchor(self.shown[key])}).\n")
                return
            self.shown[key] = path
            self.lines.append(f"{'#' * min(level, 5)} {path}\n")
            for word, kind in found.items():
                self.group(kind, f"{path}", f"`{word}`", level + 1)
        elif schema.get("properties"):
            key = json.dumps(sorted(schema["properties"])) + path.rsplit("/", 1)[-1]
            if key in self.shown:
                self.lines.append(f"`{path}` has the parameters of [`{self.shown[key]}`](#{anchor(self.shown[key])}).\n")
                return
            self.shown[key] = path
            self.group(schema, path, path, level)
        elif schema.get("type") == "array":
            self.inner(unwrap(schema.get("items", {})), f"{path}/*", level)

    def table(self, title: str, quantities: list[dict]) -> None:
        self.lines.append(f"## {title}\n\n| name | unit | meaning |\n| --- | --- | --- |")
        for quantity in quantities:
            self.lines.append(f"| `{quantity['name']}` | {cell(quantity['unit'])} | {cell(quantity['doc'])} |")
        self.lines.append("")

    def text(self) -> str:
        return MADE + "\n".join(self.lines).rstrip() + "\n"


def anchor(path: str) -> str:
    return "".join(letter for letter in path.lower() if letter.isalnum() or letter in "-_")


def scene_page(kind: dict) -> str:
    page = Page(f"`{kind['kind']}`")
    page.lines.append(f"{kind['title']}.\n\nHow it works: [its page](../../src/scenes/{kind['kind']}/README.md).\n")
    page.lines.append(f"Presets: {', '.join(f'`{name}`' for name in kind['presets']) or 'none'}. A restart may change: {', '.join(f'`{name}`' for name in kind['restart_safe'])}.\n")
    page.group(kind["schema"], "", "Parameters", 2)
    page.table("Columns of the series", kind["observables"])
    page.table("Fields of frames", kind["fields"])
    page.table("Norms of errors", kind["norms"])
    example = json.dumps(kind["example"], indent=2, ensure_ascii=False)
    page.lines.append(f"## A body that runs within seconds\n\n```json\n{example}\n```\n")
    return page.text()


def shared_page(schemas: dict) -> str:
    page = Page("Jobs and studies")
    job = {**schemas["JobSpec"], "description": None}
    job["properties"] = {name: inner for name, inner in job["properties"].items() if name != "scene"}
    page.group(job, "", "A job, beside its scene", 2)
    study = {**schemas["StudySpec"], "description": None}
    modes = {option["properties"]["mode"]["const"]: option for option in options(study["properties"]["sweep"]) if "mode" in option.get("properties", {})}
    study["properties"] = {name: inner for name, inner in study["properties"].items() if name not in ("base", "sweep")}
    page.group(study, "/study", "A study, beside its base and its sweep", 2)
    for word, mode in modes.items():
        page.group(mode, f"/sweep/{word}", f"Sweep `{word}`", 3)
    return page.text()


def requests_page(document: dict) -> str:
    page = Page("Requests")
    page.lines.append("All of them with answers and types: `/openapi.json` of a service.\n\n| request | what it does |\n| --- | --- |")
    for path, methods in document["paths"].items():
        for method, request in methods.items():
            said = request.get("summary") or (request.get("description") or "").split("\n\n")[0]
            page.lines.append(f"| `{method.upper()} {path}` | {cell(said)} |")
    return page.text()


def main(address: str, folder: str) -> None:
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    document = get(address, "/openapi.json")
    kinds_of_scenes = get(address, "/v1/scenes")["items"]
    for kind in kinds_of_scenes:
        (place / f"{kind['kind']}.md").write_text(scene_page(kind))
    (place / "jobs.md").write_text(shared_page(document["components"]["schemas"]))
    (place / "requests.md").write_text(requests_page(document))
    rows = "\n".join(f"- [`{kind['kind']}`]({kind['kind']}.md): {kind['title']}" for kind in kinds_of_scenes)
    (place / "README.md").write_text(f"{MADE}# Reference\n\n- [Requests](requests.md)\n- [Jobs and studies](jobs.md)\n{rows}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
