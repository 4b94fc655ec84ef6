"""The scanlines of Radiance pictures, decoded by a compiled loop. Ward 1991, "Real Pixels"; Radiance's own
documentation of its file formats."""

from __future__ import annotations

from raytrace.compilation import kernel


@kernel
def decode_scanlines(data, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` (H, W, 4) uint8 from ``data`` (n,) uint8; the number of rows that are whole."""
    height, width = out.shape[0], out.shape[1]
    at, size = 0, data.shape[0]
    for row in range(height):
        if at + 4 > size:
            return row
        new = data[at] == 2 and data[at + 1] == 2 and data[at + 2] < 128
        if new and 8 <= width < 32768 and (int(data[at + 2]) << 8 | int(data[at + 3])) == width:
            at += 4
            for channel in range(4):
                column = 0
                while column < width:
                    if at + 2 > size:
                        return row
                    count = int(data[at])
                    if count > 128:  # a run
                        count -= 128
                        if column + count > width:
                            return row
                        for k in range(count):
                            out[row, column + k, channel] = data[at + 1]
                        at += 2
                    else:
                        if count == 0 or column + count > width or at + 1 + count > size:
                            return row
                        for k in range(count):
                            out[row, column + k, channel] = data[at + 1 + k]
                        at += 1 + count
                    column += count
        else:  # texel by texel; 1, 1, 1, n repeats the one before n times
            column, shift = 0, 0
            while column < width:
                if at + 4 > size:
                    return row
                if data[at] == 1 and data[at + 1] == 1 and data[at + 2] == 1:
                    count = int(data[at + 3]) << shift
                    if column == 0 or shift > 16 or column + count > width:
                        return row
                    for k in range(count):
                        for channel in range(4):
                            out[row, column + k, channel] = out[row, column - 1, channel]
                    column += count
                    shift += 8
                else:
                    for channel in range(4):
                        out[row, column, channel] = data[at + channel]
                    column += 1
                    shift = 0
                at += 4
    return height
