"""What a tool takes from a height field along its way: the kernel."""

from __future__ import annotations

from math import ceil, hypot, sqrt

import numpy as np

from rds.core.compiling import kernel, long_kernel

# Columns of what is found for each number of `owner`.
VOLUME, DEPTH, RAPID, BELOW, SHANK, HOLDER = range(6)
FOUND = 6


@kernel
def _touches(field, x0, y0, cell, px, py, radius, bottom):
    """How far material is above `bottom` within `radius` of (px, py), mm; 0 where none is."""
    rows, columns = field.shape
    into = 0.0
    low = max(ceil((py - radius - y0) / cell - 0.5), 0)
    high = min(int(np.floor((py + radius - y0) / cell - 0.5)), rows - 1)
    for i in range(low, high + 1):
        dy = y0 + (i + 0.5) * cell - py
        half = sqrt(max(radius * radius - dy * dy, 0.0))
        first = max(ceil((px - half - x0) / cell - 0.5), 0)
        last = min(int(np.floor((px + half - x0) / cell - 0.5)), columns - 1)
        for j in range(first, last + 1):
            into = max(into, field[i, j] - bottom)
    return into


@long_kernel
def carve(field, x0, y0, cell, floor, points, owner, rapid, radius, profile, cutting, shank, reach, holder, found):
    """Take from `field` (rows of y, columns of x; mm) what a tool sweeps along `points` (n × 3, its tip, mm).

    The tool stands at each point, and between two at steps of half a `cell`; a cell is cut where its middle is under
    the tool. profile: heights of the tool's end above its tip at squared distances from its axis that divide radius²
    evenly. cutting: how far above the tip its edges reach; what is wider above them (radius `shank`), and the holder
    (radius `holder`, `reach` above the tip) must not touch material; 0: there is none. owner, rapid: of the way to each
    point. `found[owner]` gets the volume (mm³), the depth of the deepest cut (mm), the volume in rapids, how far below
    `floor` the tip went, and how deep shank and holder went into the material (mm).

    The depth is the mean over the cells that one step cuts, where these are more than a few: at the walls single cells
    are left by one pass and cut by the next. Of a tool with a point, and straight down, it is that under the tip, from
    where the material was before the move.
    """
    rows, columns = field.shape
    area = cell * cell
    n, fine = len(points), len(profile) - 1
    scale = fine / (radius * radius) if radius > 0.0 else 0.0
    many = max(3, int(0.5 * radius / cell))
    since = 0
    pointed = profile[fine] > profile[0]
    before, seen = np.empty((rows, columns)), np.full((rows, columns), -1, np.int64)
    x, y, z = points[0, 0], points[0, 1], points[0, 2]
    for k in range(n):
        dx, dy, dz = points[k, 0] - x, points[k, 1] - y, points[k, 2] - z
        way = hypot(hypot(dx, dy), dz)
        # nearer than a quarter of a cell to where it last stood: nothing new is under it
        if k > 0 and way < 0.25 * cell and k < n - 1 and owner[k] == owner[k + 1] and dz >= -0.02 * cell:
            continue
        steps = max(ceil(2.0 * way / cell), 1)
        who = owner[k]
        for step in range(1, steps + 1):
            part = step / steps
            px, py, pz = x + part * dx, y + part * dy, z + part * dz
            volume, count = 0.0, 0
            low = max(ceil((py - radius - y0) / cell - 0.5), 0)
            high = min(int(np.floor((py + radius - y0) / cell - 0.5)), rows - 1)
            for i in range(low, high + 1):
                away = y0 + (i + 0.5) * cell - py
                left = radius * radius - away * away
                half = sqrt(max(left, 0.0))
                first = max(ceil((px - half - x0) / cell - 0.5), 0)
                last = min(int(np.floor((px + half - x0) / cell - 0.5)), columns - 1)
                for j in range(first, last + 1):
                    if field[i, j] <= pz:
                        continue
                    across = x0 + (j + 0.5) * cell - px
                    at = min((away * away + across * across) * scale, fine * 1.0)
                    m = min(int(at), fine - 1)
                    bottom = pz + profile[m] + (at - m) * (profile[m + 1] - profile[m])
                    above = field[i, j] - bottom
                    if above > 0.0:
                        if seen[i, j] != who:
                            seen[i, j], before[i, j] = who, field[i, j]
                        volume += above
                        count += 1
                        field[i, j] = bottom
            if volume > 0.0:
                found[who, VOLUME] += volume * area
                if rapid[k]:
                    found[who, RAPID] += volume * area
                i, j = int(np.floor((py - y0) / cell)), int(np.floor((px - x0) / cell))
                inside = 0 <= i < rows and 0 <= j < columns
                if (pointed or (dx == 0.0 and dy == 0.0)) and inside and seen[i, j] == who:
                    found[who, DEPTH] = max(found[who, DEPTH], before[i, j] - pz)
                if pz < floor:
                    found[who, BELOW] = max(found[who, BELOW], floor - pz)
                if count > many:
                    deep = volume / count
                    found[who, DEPTH] = max(found[who, DEPTH], deep)
                    found[who, SHANK] = max(found[who, SHANK], deep - cutting)
            since += 1
            if since >= 4 or step == steps:
                since = 0
                if shank > 0.0:
                    into = _touches(field, x0, y0, cell, px, py, shank, pz + cutting)
                    found[who, SHANK] = max(found[who, SHANK], into)
                if holder > 0.0:
                    into = _touches(field, x0, y0, cell, px, py, holder, pz + reach)
                    found[who, HOLDER] = max(found[who, HOLDER], into)
        x, y, z = points[k, 0], points[k, 1], points[k, 2]


@kernel
def raise_triangles(field, x0, y0, cell, corners):
    """Lift `field` to the top of triangles (n × 3 × 3, mm) over the middles of its cells."""
    rows, columns = field.shape
    for k in range(len(corners)):
        a, b, c = corners[k, 0], corners[k, 1], corners[k, 2]
        twice = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
        if twice == 0.0:
            continue
        low_j = max(ceil((min(a[0], b[0], c[0]) - x0) / cell - 0.5), 0)
        high_j = min(int(np.floor((max(a[0], b[0], c[0]) - x0) / cell - 0.5)), columns - 1)
        low_i = max(ceil((min(a[1], b[1], c[1]) - y0) / cell - 0.5), 0)
        high_i = min(int(np.floor((max(a[1], b[1], c[1]) - y0) / cell - 0.5)), rows - 1)
        for i in range(low_i, high_i + 1):
            y = y0 + (i + 0.5) * cell
            for j in range(low_j, high_j + 1):
                x = x0 + (j + 0.5) * cell
                u = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / twice
                v = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / twice
                if u >= -1e-9 and v >= -1e-9 and u + v <= 1.0 + 1e-9:
                    field[i, j] = max(field[i, j], a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2]))
