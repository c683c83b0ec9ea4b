"""Pictures as PNG files, by the standard library (PNG specification, W3C 2003: 8 bit RGB, one IDAT chunk)."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def png(pixels: NDArray[np.uint8]) -> bytes:
    """Encode (height, width, 3) pixels."""
    height, width = pixels.shape[:2]
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, width * 3)], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 6)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )


def write(path: Path, pixels: NDArray[np.uint8]) -> None:
    """Write pixels to ``path``, through a temporary file beside it; raises ``OSError`` as writing does."""
    temporary = path.with_name(path.name + ".part")
    temporary.write_bytes(png(pixels))
    os.replace(temporary, path)
