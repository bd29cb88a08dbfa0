# SPDX-License-Identifier: BSD-3-Clause
"""A sphere and a tilted plate under one distant light and one sky, for Gonio, Radiance and Cycles.

usage: scene.py FOLDER SIZE SPHERE PLATE         models: scene.ini, sphere.obj, plate.obj, sky.pfm, scene.json
       scene.py --radiance FOLDER XML:ARGUMENTS XML:ARGUMENTS     scene.rad; arguments as `gonio convert` tells them
       scene.py --strip EV OUT.png A.pfm B.pfm ...     pictures beside each other, as 8-bit sRGB
       scene.py --mean SIDE TIMES IN OUT.pfm     pixels of pvalue (-h -H -d), SIDE x TIMES a way, as means

All of the sphere lies behind the plate's plane, so that neither reflects the other and no path has a second bounce."""
import json
import math
import os
import struct
import sys
import zlib

EYE, FOV, TOWARD, IRRADIANCE = (0, 0, 6), 38.0, (0.55, 0.55, 0.63), 1.2
LOW, RISE = (0.30, 0.28, 0.26), (0.05, 0.12, 0.25)
SPHERE, PLATE, TILT, HALF = (-1.0, 0, 0), (0.95, 0, 0), math.radians(50), 0.95


def unit(v):
    n = math.sqrt(sum(x * x for x in v))
    return tuple(x / n for x in v)


def write(folder, name, text):
    with open(os.path.join(folder, name), "w") as file:
        file.write(text)


def sphere():
    """u turns about the vertical toward +x of its front: dp/du and dp/dv are x and y of the sample."""
    turns, rings, lines, faces = 192, 96, [], []
    for j in range(rings + 1):
        for i in range(turns + 1):
            a, b = 2 * math.pi * i / turns - math.pi, math.pi * (j / rings - 0.5)
            n = (math.sin(a) * math.cos(b), math.sin(b), math.cos(a) * math.cos(b))
            place = [SPHERE[k] + n[k] for k in range(3)]
            lines.append("v %.9g %.9g %.9g\nvt %.9g %.9g\nvn %.9g %.9g %.9g\n" % (*place, i / turns, j / rings, *n))
    for j in range(rings):
        for i in range(turns):
            low = j * (turns + 1) + i + 1
            corners = [low, low + 1, low + turns + 2, low + turns + 1]
            for three in ([0, 1, 2], [0, 2, 3]):
                distinct = j > 0 if three == [0, 1, 2] else j < rings - 1
                if distinct:  # at a pole the other one has no area
                    faces.append("f " + " ".join("%d/%d/%d" % ((corners[k],) * 3) for k in three) + "\n")
    return "".join(lines + faces)


def plate_corners():
    x = (math.cos(TILT), 0, -math.sin(TILT))
    return [tuple(PLATE[k] + HALF * (a * x[k] + b * (k == 1)) for k in range(3)) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def plate():
    n = "vn %.9g 0 %.9g\n" % (math.sin(TILT), math.cos(TILT))
    corners = "".join("v %.9g %.9g %.9g\n" % c for c in plate_corners())
    return corners + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n" + n + "f 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/4/1\n"


def pfm(path, width, height, rows):
    """rows from the top."""
    with open(path, "wb") as file:
        file.write(b"PF\n%d %d\n-1.0\n" % (width, height))
        for row in reversed(rows):
            file.write(struct.pack("<%df" % (3 * width), *row))


def scene(folder, size, sphere_model, plate_model):
    os.makedirs(folder, exist_ok=True)
    write(folder, "sphere.obj", sphere())
    write(folder, "plate.obj", plate())
    width, height = 256, 128
    up = [math.sin(math.pi * (0.5 - (j + 0.5) / height)) for j in range(height)]
    pfm(os.path.join(folder, "sky.pfm"), width, height, [[LOW[c] + RISE[c] * y for c in range(3)] * width for y in up])
    toward = unit(TOWARD)
    facts = {"size": int(size), "eye": EYE, "fov": FOV, "toward": toward, "irradiance": IRRADIANCE, "low": LOW, "rise": RISE}
    write(folder, "scene.json", json.dumps(facts))
    slashes = lambda v: "/".join("%.9g" % x for x in v)
    write(folder, "scene.ini",
          f"[image]\nwidth = {size}\nheight = {size}\nsamples = 1024\n[camera front]\neye = {slashes(EYE)}\ntarget = 0\nfov = {FOV}\n"
          f"[material sphere]\nmodel = {sphere_model}\n[material plate]\nmodel = {plate_model}\n"
          "[mesh sphere]\nfile = sphere.obj\nmaterial = sphere\n[mesh plate]\nfile = plate.obj\nmaterial = plate\n"
          f"[light sun]\ntoward = {slashes(toward)}\nintensity = {IRRADIANCE}\n[light sky]\nkind = environment\nfile = sky.pfm\n")


def radiance(folder, sphere_table, plate_table):
    toward, angle = unit(TOWARD), 0.1
    light = IRRADIANCE / (math.pi * math.sin(math.radians(angle / 2)) ** 2)
    text = ["void light sun_light\n0\n0\n3 %.9g %.9g %.9g\nsun_light source sun\n0\n0\n4 %.9g %.9g %.9g %g\n" % (light, light, light, *toward, angle)]
    write(folder, "sky.cal", "".join(f"sky{'rgb'[c]} = {LOW[c]} + {RISE[c]} * Dy;\n" for c in range(3)))
    text.append(f"void colorfunc sky_colour\n4 skyr skyg skyb {folder}/sky.cal\n0\n0\nsky_colour glow sky_glow\n0\n0\n4 1 1 1 0\n"
                "sky_glow source sky\n0\n0\n4 0 1 0 360\n")
    for name, table in (("sphere", sphere_table), ("plate", plate_table)):
        xml, arguments = table.split(":")
        text.append(f"void BSDF {name}_material\n6 0 {xml} 0 1 0 .\n0\n{arguments}\n")
    text.append("sphere_material sphere ball\n0\n0\n4 %g %g %g 1\n" % SPHERE)
    text.append("plate_material polygon plate\n0\n0\n12 " + " ".join("%.9g %.9g %.9g" % c for c in plate_corners()) + "\n")
    write(folder, "scene.rad", "".join(text))


def mean(side, times, source, out):
    side, times = int(side), int(times)
    rows = [[0.0] * (3 * side) for _ in range(side)]
    with open(source) as file:
        for k, line in enumerate(file):
            i, j = k % (side * times) // times, k // (side * times) // times
            for c, v in enumerate(line.split()):
                rows[j][3 * i + c] += float(v) / times ** 2
    pfm(out, side, side, rows)


def code(light):
    v = min(max(light, 0), 1)
    return round(255 * (12.92 * v if v <= 0.0031308 else 1.055 * v ** (1 / 2.4) - 0.055))


def strip(ev, out, *paths):
    scale, rows = 2 ** float(ev), None
    for path in paths:
        with open(path, "rb") as file:
            file.readline()
            width, height = (int(n) for n in file.readline().split())
            order = "<" if float(file.readline()) < 0 else ">"
            values = struct.unpack(order + "%df" % (3 * width * height), file.read())
        mine = [bytes(code(scale * v) for v in values[3 * width * j : 3 * width * (j + 1)]) for j in reversed(range(height))]
        rows = mine if rows is None else [a + b for a, b in zip(rows, mine)]
    part = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    with open(out, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + part(b"IHDR", struct.pack(">IIBBBBB", len(rows[0]) // 3, len(rows), 8, 2, 0, 0, 0)) +
                   part(b"IDAT", zlib.compress(b"".join(b"\0" + r for r in rows), 9)) + part(b"IEND", b""))


if sys.argv[1] == "--radiance":
    radiance(*sys.argv[2:])
elif sys.argv[1] == "--strip":
    strip(*sys.argv[2:])
elif sys.argv[1] == "--mean":
    mean(*sys.argv[2:])
else:
    scene(*sys.argv[1:])
