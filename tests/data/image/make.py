#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Makes the pictures of this folder, for tests/test_image.c, which has the same formulas.

cv2 writes what it can; the kinds of PNG that it cannot (palette, 1, 2 and 4 bits, grey with alpha,
interlaced) are put together from the PNG specification.
"""
import struct
import zlib

import cv2
import numpy as np

W, H = 19, 11
y, x = np.mgrid[0:H, 0:W].astype(np.int64)
grey8 = (7 * x + 13 * y + x * y) & 255
grey16 = (2621 * x + 4099 * y + 17 * x * y) & 65535
rgb8 = np.dstack([grey8, (13 * x + 7 * y) & 255, (5 * x + 3 * y + 40) & 255])
rgb16 = np.dstack([grey16, (4099 * x + 2621 * y) & 65535, (1031 * x + 509 * y) & 65535])
alpha8 = (x * 31 + y) & 255

PASSES = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def scanlines(samples, depth):
    """Rows with filter 0; samples is (h, w, channels)."""
    out = b""
    for row in samples:
        values = row.reshape(-1)
        if depth == 16:
            packed = values.astype(">u2").tobytes()
        elif depth == 8:
            packed = values.astype("u1").tobytes()
        else:
            bits = "".join(format(v, f"0{depth}b") for v in values)
            bits += "0" * (-len(bits) % 8)
            packed = bytes(int(bits[i : i + 8], 2) for i in range(0, len(bits), 8))
        out += b"\0" + packed
    return out


def png(name, samples, colour_type, depth, interlaced=False, extra=b""):
    s = samples.reshape(H, W, -1)
    passes = [s[v::dv, u::du] for u, v, du, dv in PASSES] if interlaced else [s]
    data = b"".join(scanlines(p, depth) for p in passes if p.size)
    with open(name, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n")
        f.write(chunk(b"IHDR", struct.pack(">IIBBBBB", W, H, depth, colour_type, 0, 0, interlaced)))
        f.write(extra + chunk(b"IDAT", zlib.compress(data, 9)) + chunk(b"IEND", b""))


def palette(n):
    """Colour k of the palette is (3k, 255 - 5k, 7k) mod 256; every second one is half transparent."""
    colours = bytes(v & 255 for k in range(n) for v in (3 * k, 255 - 5 * k, 7 * k))
    return chunk(b"PLTE", colours) + chunk(b"tRNS", bytes(128 if k % 2 else 255 for k in range(n)))


def pgm(name, header, body):
    with open(name, "wb") as f:
        f.write(header + body)


cv2.imwrite("grey8.png", grey8.astype("u1"))
cv2.imwrite("grey16.png", grey16.astype("u2"))
cv2.imwrite("rgb8.png", rgb8[..., ::-1].astype("u1"))
cv2.imwrite("rgb16.png", rgb16[..., ::-1].astype("u2"))
cv2.imwrite("rgba8.png", np.dstack([rgb8[..., ::-1], alpha8]).astype("u1"))
for depth in (1, 2, 4):
    png(f"grey{depth}.png", (x + 2 * y) & ((1 << depth) - 1), 0, depth)
for depth in (1, 2, 4, 8):
    png(f"palette{depth}.png", grey8 & ((1 << depth) - 1), 3, depth, extra=palette(1 << depth))
png("greya8.png", np.dstack([grey8, alpha8]), 4, 8)
png("greya16.png", np.dstack([grey16, alpha8 * 257]), 4, 16)
png("rgba16.png", np.dstack([rgb16, alpha8 * 257]), 6, 16)
png("interlaced_grey1.png", (x + 2 * y) & 1, 0, 1, True)
png("interlaced_grey16.png", grey16, 0, 16, True)
png("interlaced_rgb8.png", rgb8, 2, 8, True)
png("interlaced_rgb16.png", rgb16, 2, 16, True)
png("interlaced_palette4.png", grey8 & 15, 3, 4, True, palette(16))

cv2.imwrite("grey8.pgm", grey8.astype("u1"))
cv2.imwrite("grey16.pgm", grey16.astype("u2"))
pgm("max100.pgm", b"P5 # white is 100\n19\t11\n#\n100\n", (grey8 % 101).astype("u1").tobytes())
pgm("max4095.pgm", b"P5\n19 11\n4095\n", (grey16 & 4095).astype(">u2").tobytes())
pgm("text8.pgm", b"P2\n19 11 255\n", " ".join(map(str, grey8.reshape(-1))).encode() + b"\n")
pgm("text4095.pgm", b"P2\n19 11\n4095\n", "\n".join(map(str, (grey16 & 4095).reshape(-1))).encode() + b"\n")

# Smooth, so that JPEG keeps it to a few levels; no multiple of its blocks.
v, u = np.mgrid[0:29, 0:45]
smooth = np.dstack([2 * u + 3 * v + 20, 200 - 2 * u, 5 * v + 30])
cv2.imwrite("grey.jpg", smooth[..., 0].astype("u1"), [cv2.IMWRITE_JPEG_QUALITY, 98])
cv2.imwrite("colour.jpg", smooth[..., ::-1].astype("u1"), [cv2.IMWRITE_JPEG_QUALITY, 98])
cv2.imwrite("progressive.jpg", smooth[..., ::-1].astype("u1"),
            [cv2.IMWRITE_JPEG_QUALITY, 98, cv2.IMWRITE_JPEG_PROGRESSIVE, 1])

# A scan of four frames; frame k has the level 50 k + x + y.
for k in range(4):
    v, u = np.mgrid[0:12, 0:16]
    cv2.imwrite(f"scan/{k}.png", (50 * k + u + v).astype("u1"))
