"""Checks what is in a wheel and in a source distribution: python .ci/package.py WHEEL SDIST."""

import email
import sys
import tarfile
import zipfile

PACKED = (
    "jounce/__init__.pyi",
    "jounce/py.typed",
    "jounce/examples/four_bar.yaml",
    "jounce/examples/robots/panda.urdf",
    "jounce/io/mechanisms/schema/mechanism.schema.json",
    "jounce/plot/jounce.mplstyle",
    "jounce/plot/page/report.html",
    "jounce/plot/page/report.js",
    "jounce/plot/page/report.css",
)
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "constraints.txt", "src/jounce/__init__.py",
           "tests/test_package.py", "docs/index.md", "examples/four_bar.yaml")  # fmt: skip
KEYS = ("Name", "Version", "Summary", "Requires-Python", "License-Expression")
LARGEST = 8_000_000  # bytes of a wheel


def main(wheel: str, sdist: str) -> None:
    """Exit with a message unless both have what users need, and nothing else."""
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        metadata = email.message_from_bytes(archive.read(next(n for n in names if n.endswith(".dist-info/METADATA"))))
        size = sum(entry.compress_size for entry in archive.infolist())
    with tarfile.open(sdist) as archive:
        sources = [name.partition("/")[2] for name in archive.getnames()]
    faults = [f"the wheel has no {name}" for name in PACKED if name not in names]
    faults += [f"the source distribution has no {name}" for name in SOURCES if name not in sources]
    faults += [f"the wheel has {name}" for name in names if name.startswith("tests/") or "__pycache__" in name]
    faults += [f"the wheel has {size} bytes"] * (size > LARGEST)
    faults += [f"the metadata has no {key}" for key in KEYS if not metadata[key]]
    if not metadata.get_payload().startswith("# jounce"):
        faults.append("the description is not the README")
    if faults:
        sys.exit("\n".join(faults))
    print(f"{wheel}: {len(names)} files, {size} bytes; {sdist}: {len(sources)} files")


if __name__ == "__main__":
    main(*sys.argv[1:])
