#!/usr/bin/env python3
"""Packs a release: the program, licences, a bill of materials (CycloneDX) and checksums, as one archive with fixed times and owners.

dist.py PROGRAM FOLDER   writes FOLDER/meniscus-VERSION-x86-64-v3.tar.gz and its digest
"""

import gzip
import hashlib
import io
import json
import pathlib
import re
import subprocess
import sys
import tarfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
PLATFORM = "x86_64-unknown-linux-gnu"
FILES = ["LICENSE-APACHE", "LICENSE-MIT", "README.md", "CHANGELOG.md", "deploy/README.md", "deploy/config.example.toml", "deploy/meniscus.service",
         "deploy/slurm/README.md", "deploy/slurm/config.toml"]


def run(*command):
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


def packages():
    """Every package whose code is in the program, or that makes it, with its digest in the registry."""
    metadata = json.loads(run("cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform", PLATFORM))
    by_id = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    waiting = [package["id"] for package in metadata["packages"] if package["name"] == "meniscus-api"]
    found = set()
    while waiting:
        which = waiting.pop()
        if which in found:
            continue
        found.add(which)
        for dependency in nodes[which]["deps"]:
            if any(kind["kind"] != "dev" for kind in dependency["dep_kinds"]):
                waiting.append(dependency["pkg"])
    locked = re.findall(r'name = "([^"]+)"\nversion = "([^"]+)"\nsource = "[^"]+"\nchecksum = "([0-9a-f]+)"', (ROOT / "Cargo.lock").read_text())
    digests = {(name, version): digest for name, version, digest in locked}
    for package in sorted((by_id[which] for which in found), key=lambda package: (package["name"], package["version"])):
        yield package, digests.get((package["name"], package["version"]))


def bill(all_packages, version):
    components = []
    for package, digest in all_packages:
        purl = f"pkg:cargo/{package['name']}@{package['version']}"
        component = {"type": "library", "bom-ref": purl, "name": package["name"], "version": package["version"], "purl": purl}
        if package.get("license"):
            component["licenses"] = [{"expression": package["license"].replace("/", " OR ")}]
        if digest:
            component["hashes"] = [{"alg": "SHA-256", "content": digest}]
        components.append(component)
    # What the program is linked to and does not contain.
    components.append({"type": "library", "bom-ref": "libhdf5", "name": "libhdf5", "scope": "required", "description": "shared library of the system"})
    return {"bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1,
            "metadata": {"component": {"type": "application", "name": "meniscus", "version": version}}, "components": components}


def licences(all_packages):
    """The texts of the licences of others, each once."""
    texts = {}
    for package, digest in all_packages:
        if digest is None:
            continue
        folder = pathlib.Path(package["manifest_path"]).parent
        named = f"{package['name']} {package['version']} ({package.get('license') or 'see its text'})"
        files = sorted(file for file in folder.iterdir() if re.match(r"(?i)(licen[cs]e|copying|notice|unlicense)", file.name) and file.is_file())
        if not files:
            texts.setdefault("(its archive has no text of its own)", []).append(named)
        for file in files:
            texts.setdefault(file.read_text(errors="replace").strip(), []).append(named)
    parts = ["\n".join(names) + "\n\n" + text for text, names in sorted(texts.items(), key=lambda pair: pair[1])]
    return ("\n\n" + "=" * 80 + "\n\n").join(parts) + "\n"


def pack(target, folder, content, when):
    raw = io.BytesIO()
    with tarfile.open(fileobj=raw, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        for name, (data, mode) in sorted(content.items()):
            entry = tarfile.TarInfo(f"{folder}/{name}")
            entry.size, entry.mode, entry.mtime = len(data), mode, when
            entry.uname = entry.gname = "root"
            archive.addfile(entry, io.BytesIO(data))
    with open(target, "wb") as file, gzip.GzipFile(filename="", fileobj=file, mode="wb", mtime=when) as packed:
        packed.write(raw.getvalue())


def main():
    program, target = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    version = re.search(r'^version = "([^"]+)"', (ROOT / "Cargo.toml").read_text(), re.MULTILINE).group(1)
    when = int(run("git", "log", "-1", "--format=%ct").strip())
    all_packages = list(packages())
    content = {"meniscus": (program.read_bytes(), 0o755)}
    for name in FILES:
        content[name] = ((ROOT / name).read_bytes(), 0o644)
    content["sbom.cdx.json"] = (json.dumps(bill(all_packages, version), indent=1).encode(), 0o644)
    content["THIRD-PARTY-LICENSES.txt"] = (licences(all_packages).encode(), 0o644)
    sums = "".join(f"{hashlib.sha256(data).hexdigest()}  {name}\n" for name, (data, _) in sorted(content.items()))
    content["SHA256SUMS"] = (sums.encode(), 0o644)
    folder = f"meniscus-{version}-x86-64-v3"
    target.mkdir(parents=True, exist_ok=True)
    archive = target / f"{folder}.tar.gz"
    pack(archive, folder, content, when)
    digest = hashlib.sha256(archive.read_bytes()).hexdigest()
    (target / f"{folder}.tar.gz.sha256").write_text(f"{digest}  {archive.name}\n")
    print(f"{archive}: {archive.stat().st_size / 2**20:.1f} MB, {len(all_packages)} packages, SHA-256 {digest}")


main()
