"""What a wheel holds: the three packages with their data, nothing else; prints how many files, or
fails."""

import sys
import zipfile
from collections import Counter
from pathlib import PurePosixPath

PACKAGES = {"model", "estimators", "sandbox"}
DATA = {".py", ".toml", ".json", ".c", ".h", ".parquet", ".html", ".css", ".js", ".typed"}

names = [PurePosixPath(n) for n in zipfile.ZipFile(sys.argv[1]).namelist()]
inside = [n for n in names if not n.parts[0].endswith(".dist-info")]
strange = [
    str(n)
    for n in inside
    if n.parts[0] not in PACKAGES or n.suffix not in DATA or "tests" in n.parts
]
if strange:
    sys.exit(f"no package data: {', '.join(strange[:10])}")
print(dict(Counter(n.suffix for n in inside)))
