"""Random changes to the text of files: bytes, keys that stand there twice, limits, cells of a table."""

import copy
import json
import re

from tests.mutations import FACTORS, Data, Rng, number, pick, structure


def text(rng: Rng, content: bytes) -> tuple[bytes, str]:
    """Bytes are lost, changed, doubled or put in."""
    at, way = int(rng.integers(max(len(content), 1))), rng.integers(5)
    if way == 0:
        return content[:at], f"cut off at byte {at}"
    if way == 1:
        return content[:at] + bytes([int(rng.integers(256))]) + content[at + 1 :], f"byte {at} changed"
    if way == 2:
        return content[:at] + content[max(at - 40, 0) :], f"bytes before {at} twice"
    if way == 3:
        return pick(rng, (b"\xef\xbb\xbf", b"\x00", b"[" * 5000, b"\n")) + content, "bytes in front"
    lines = content.split(b"\n")
    rng.shuffle(lines)
    return b"\n".join(lines), "lines shuffled"


def doubled_key(rng: Rng, data: Data) -> tuple[bytes, str]:
    """A key of the file stands there twice, with another value."""
    key = pick(rng, sorted(data))
    other = copy.deepcopy(data)
    structure(rng, other)
    end = f", {json.dumps(key)}: {json.dumps(other.get(key))}}}"
    return (json.dumps(data)[:-1] + end).encode(), f"key {key} twice"


def limits(rng: Rng, content: str) -> tuple[str, str]:
    """Of a limits file: a number, a line, or a pair of bounds that is very wide on one side."""
    lines = content.splitlines()
    numbered = [i for i, line in enumerate(lines) if re.search(r"\d", line.split("#")[0]) and "format" not in line]
    way, i = rng.integers(10), int(pick(rng, numbered))
    if way == 0:
        gone = lines.pop(int(rng.integers(len(lines))))
        return "\n".join(lines), f"without {gone!r}"
    if way == 1:
        lines.insert(i, lines[i])
        return "\n".join(lines), f"twice {lines[i]!r}"
    if way == 2 and (bounds := [i for i, line in enumerate(lines) if line.startswith("limit = [")]):
        i = int(pick(rng, bounds))
        values = json.loads(lines[i].removeprefix("limit = "))
        wide, near = pick(rng, (1e6, 1e12, 1e15, 1e299, 1e301)), pick(rng, (0.3, 0.6, 1.0))
        lines[i] = f"lower = {[-wide] * len(values)}\nupper = {[near * value for value in values]}"
        return "\n".join(lines), f"lower bounds {-wide}, upper ones times {near}"
    if way == 3 and "" in lines and rng.random() < 0.3:
        head = [line for line in lines[: lines.index("")] if not line.startswith("continuity")]
        return "\n".join([*head, f"continuity = {rng.integers(5)}"]), "nothing but continuity"
    if way == 3:
        lines[i] += pick(rng, ("]", " = 3", "\n[rest]", "\ncontinuity = 3", '\nother = "x"'))
        return "\n".join(lines), f"now {lines[i]!r}"
    spots = list(re.finditer(r"-?\d+(\.\d+)?(e-?\d+)?", lines[i].split("#")[0]))
    spot = pick(rng, spots)
    value = float(spot.group())
    other = pick(
        rng, (*(value * f for f in FACTORS), value - 0.05, 0.0, -value, "inf", "nan", "1e301", "1e999", "true", "[]")
    )
    lines[i] = lines[i][: spot.start()] + str(other) + lines[i][spot.end() :]
    return "\n".join(lines), f"now {lines[i]!r}"


def cell(rng: Rng, content: str) -> tuple[str, str]:
    """A cell of a front's table: a number, or a verdict."""
    rows = [line.split(",") for line in content.splitlines()]
    row = rows[int(rng.integers(1, len(rows)))] if rng.random() < 0.95 else rows[0]
    if rng.random() < 0.3:
        row[-1] = pick(rng, ("proved", "proved", "violated", "undecided", "", "PROVED"))
        return "\n".join(map(",".join, rows)) + "\n", f"verdict {row[-1]!r}"
    i = int(rng.integers(len(row)))
    try:
        row[i] = repr(number(rng, float(row[i])))
    except ValueError:
        row[i] = "other"
    return "\n".join(map(",".join, rows)) + "\n", f"cell {i} = {row[i]}"
