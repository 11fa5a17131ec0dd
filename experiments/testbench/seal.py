"""Truths under a seal: a file whose SHA-256 is known before the first campaign exists."""

import hashlib
import json
import os
import zlib
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .draw import Truth

SEALED, HASH = "truth.sealed", "SHA256"


def stream(key: str, n: int) -> bytes:
    """n bytes that hide a text from a casual look: SHA-256 over key and counter."""
    out = b"".join(hashlib.sha256(f"{key} {k}".encode()).digest() for k in range(n // 32 + 1))
    return out[:n]


def pack(truths: dict[str, Truth], facts: dict[str, Any], key: str = "") -> bytes:
    """Truths by campaign name and the facts of the draw, compressed; with a key also enciphered."""
    text = json.dumps(
        {"facts": facts, "truths": {n: asdict(t) for n, t in truths.items()}}, sort_keys=True
    )
    packed = zlib.compress(text.encode(), 9)
    return (
        bytes(a ^ b for a, b in zip(packed, stream(key, len(packed)), strict=True))
        if key
        else packed
    )


def unpack(folder: str | os.PathLike, key: str = "") -> dict[str, Any]:
    """Open a seal: {"facts": ..., "truths": {campaign: ...}}.

    Raises ValueError where the file is not the one whose hash was written, or the key is another.
    """
    place = Path(folder)
    packed = (place / SEALED).read_bytes()
    stated = (place / HASH).read_text().split()[0]
    if hashlib.sha256(packed).hexdigest() != stated:
        raise ValueError(
            f"{place / SEALED} is not the file whose SHA-256 is in {place / HASH}: it was changed"
        )
    try:
        text = zlib.decompress(
            bytes(a ^ b for a, b in zip(packed, stream(key, len(packed)), strict=True))
            if key
            else packed
        )
    except zlib.error as e:
        raise ValueError(f"{place / SEALED} does not open with this key") from e
    return json.loads(text)


def write_seal(folder: Path, packed: bytes) -> str:
    """Write seal and hash, hash first; a seal that is there must be the same, so that a run that
    goes on keeps it."""
    digest = hashlib.sha256(packed).hexdigest()
    place = folder / HASH
    if place.exists() and place.read_text().split()[0] != digest:
        raise ValueError(
            f"{folder} holds campaigns of another draw (its {HASH} differs): choose another folder"
        )
    folder.mkdir(parents=True, exist_ok=True)
    for path, data in ((place, f"{digest}  {SEALED}\n".encode()), (folder / SEALED, packed)):
        temporary = path.with_name(f".{path.name}.{os.getpid()}")
        temporary.write_bytes(data)
        os.replace(temporary, path)
    return digest
