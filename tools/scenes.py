#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Scenes with microgeometry, made by rule: OBJ meshes with texture coordinates and the INI files that light them.

usage: tools/scenes.py ball|cylinder|bolt|wall|gargoyle FOLDER [SIZE]

ball:     a sphere under SIZE suns (1 to 4), smooth; ward.ini and ggx.ini, of which docs/scene-driven.md tells
cylinder: ridges along the axis, whose two sides are yellow and blue in turn (Wu, Dorsey and Rushmeier 2009, fig. 1); SIZE ridges (96)
bolt:     a shaft with diamond-shaped bumps under a hexagonal head; SIZE bumps around (24)
wall:     bricks of uneven height and depth in mortar; SIZE bricks across (12)
gargoyle: a bumpy body with horns and a snout, in enamel of cells between gold (Worley 1996; fig. 7); SIZE faces from pole to
          pole (100; 316 has the paper's 200,000 triangles)
"""
import math
import os
import random
import sys


def write_obj(path, faces):
    """faces: (material, corners), each corner (x, y, z, u, v)."""
    with open(path, "w", encoding="ascii") as out:
        number, last = 0, None
        for material, corners in faces:
            if material != last:
                out.write(f"usemtl {material}\n")
                last = material
            for x, y, z, u, v in corners:
                out.write(f"v {x:.7g} {y:.7g} {z:.7g}\nvt {u:.7g} {v:.7g}\n")
            out.write("f " + " ".join(f"{number + k + 1}/{number + k + 1}" for k in range(len(corners))) + "\n")
            number += len(corners)


def write_ini(path, mesh, materials, camera, lights):
    with open(path, "w", encoding="ascii") as out:
        out.write("[image]\nwidth = 512\nheight = 512\nsamples = 256\n" + camera)
        for name, model in materials:
            out.write(f"[material {name}]\nmodel = {model}\n")
        out.write(f"[mesh object]\nfile = {mesh}\nsmooth = 0\n" + lights)


# Ridges seen from +z: of each, the side toward -x is blue, the other one yellow, as the light comes from -x.
def cylinder(folder, ridges=96, rows=16, depth=0.045):
    ring = []
    for k in range(2 * ridges):
        angle = 2 * math.pi * k / (2 * ridges)
        radius = 1 if k % 2 else 1 - depth
        ring.append((radius * math.sin(angle), radius * math.cos(angle)))
    ring.append(ring[0])
    faces = []
    for k in range(2 * ridges):
        (x0, z0), (x1, z1) = ring[k], ring[k + 1]
        u0, u1 = k / (2 * ridges), (k + 1) / (2 * ridges)
        for j in range(rows):
            y0, y1 = 2 * j / rows - 1, 2 * (j + 1) / rows - 1
            v0, v1 = j / rows / math.pi, (j + 1) / rows / math.pi  # texels as tall as they are wide
            faces.append(("blue" if k % 2 == 0 else "yellow",
                          [(x0, y0, z0, u0, v0), (x1, y0, z1, u1, v0), (x1, y1, z1, u1, v1), (x0, y1, z0, u0, v1)]))
    write_obj(os.path.join(folder, "cylinder.obj"), faces)
    write_ini(os.path.join(folder, "cylinder.ini"), "cylinder.obj",
              [("blue", "lambert:rho=0.08/0.12/0.8"), ("yellow", "lambert:rho=0.8/0.7/0.05")],
              "[camera near]\neye = 0/0/7\nfov = 24\n[camera far]\neye = 0/0/28\nfov = 24\n",
              "[light lamp]\ntoward = -0.8/0.2/0.6\nintensity = 3\n")


def bolt(folder, bumps=24, rows=40, depth=0.07):
    def at(k, j, radius):
        angle = 2 * math.pi * k / (4 * bumps)
        return (radius * math.sin(angle), 2.4 * j / (2 * rows) - 1.2, radius * math.cos(angle))
    faces, n, height = [], 4 * bumps, 0.76  # 2.4 of a girth of pi
    for j in range(2 * rows):
        for k in range(n):
            corners = []
            for dk, dj in ((0, 0), (1, 0), (1, 1), (0, 1)):
                # Diamonds: the height falls with the distance from the centres of a quincunx.
                a, b = (k + dk) / 4, (j + dj) / 4
                near = min(abs(a - round(a)) + abs(b - round(b)), abs(a - math.floor(a) - 0.5) + abs(b - math.floor(b) - 0.5))
                x, y, z = at(k + dk, j + dj, 0.5 + depth * max(0, 1 - 2.4 * near))
                corners.append((x, y, z, (k + dk) / n, height * (j + dj) / (2 * rows)))
            faces.append(("metal", corners))
    for k in range(6):  # the head: its sides and its top
        a, b = math.pi * k / 3, math.pi * (k + 1) / 3
        p, q = (math.sin(a), math.cos(a)), (math.sin(b), math.cos(b))
        u, w = k / 6, (k + 1) / 6
        faces.append(("metal", [(p[0], 1.2, p[1], u, 0.86), (q[0], 1.2, q[1], w, 0.86), (q[0], 1.7, q[1], w, 0.92), (p[0], 1.7, p[1], u, 0.92)]))
        for y, v, order in ((1.7, 0.93, 1), (1.2, 0.97, -1)):
            top = [(0, y, 0, u, v + 0.03), (p[0], y, p[1], u, v), (q[0], y, q[1], w, v)]
            faces.append(("metal", top[::order]))
    write_obj(os.path.join(folder, "bolt.obj"), faces)
    write_ini(os.path.join(folder, "bolt.ini"), "bolt.obj", [("metal", "ggx:rho_d=0.05,rho_s=0.5,alpha=0.25")],
              "[camera near]\neye = 0/0.5/9\ntarget = 0/0.2/0\nfov = 24\n[camera far]\neye = 0/2/36\ntarget = 0/0.2/0\nfov = 24\n",
              "[light lamp]\ntoward = -0.6/0.4/0.7\nintensity = 3\n[light sky]\nkind = environment\nintensity = 0.2\nvisible = 0\n")


def wall(folder, across=12, pixels=16):
    rng = random.Random(1)
    n = across * pixels
    rows = across * 2
    tall = n // rows
    bricks = [[rng.uniform(0.6, 1) for _ in range(across + 1)] for _ in range(rows)]
    rough = [[rng.uniform(-0.15, 0.15) for _ in range(n + 1)] for _ in range(n + 1)]

    def height(i, j):
        row = min(j // tall, rows - 1)
        shift = (pixels // 2) * (row % 2)
        column = (i + shift) // pixels
        mortar = (i + shift) % pixels < 2 or j % tall < 2
        return 0.03 * (0 if mortar else bricks[row][column] + rough[j][i])

    faces = []
    for j in range(n):
        for i in range(n):
            corners = [((i + a) * 2 / n - 1, (j + b) * 2 / n - 1, height(i + a, j + b), (i + a) / n, (j + b) / n)
                       for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
            faces.append(("brick" if corners[0][2] > 0 else "mortar", corners))
    write_obj(os.path.join(folder, "wall.obj"), faces)
    write_ini(os.path.join(folder, "wall.ini"), "wall.obj",
              [("brick", "lambert:rho=0.5/0.2/0.12"), ("mortar", "lambert:rho=0.55/0.52/0.48")],
              "[camera near]\neye = 1.5/-0.5/5\nfov = 26\n[camera far]\neye = 6/-2/20\nfov = 26\n",
              "[light lamp]\ntoward = -0.9/0.4/0.35\nintensity = 3\n[light sky]\nkind = environment\nintensity = 0.3\nvisible = 0\n")


def gargoyle(folder, rows=100, cells=160, colours=5):
    rng = random.Random(2)
    def unit(x, y, z):
        length = math.sqrt(x * x + y * y + z * z)
        return (x / length, y / length, z / length)
    def dot(a, b):
        return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    seeds = [unit(*(rng.gauss(0, 1) for _ in range(3))) for _ in range(cells)]
    bumps = [unit(*(rng.gauss(0, 1) for _ in range(3))) for _ in range(60)]
    # Two horns, a snout, two shoulders: direction, how far out, how narrow.
    parts = [(unit(-0.5, 0.9, 0.1), 0.7, 14), (unit(0.5, 0.9, 0.1), 0.7, 14), (unit(0, 0.1, 1), 0.45, 9), (unit(-1, -0.2, -0.3), 0.35, 6), (unit(1, -0.2, -0.3), 0.35, 6)]

    def radius(w):
        large = sum(out * math.exp(narrow * (dot(w, axis) - 1) * 2) for axis, out, narrow in parts)
        fine = sum(math.cos(40 * dot(w, axis)) for axis in bumps) / len(bumps)
        return 1 + large + 0.12 * fine

    def corner(i, j):
        u, v = i / (2 * rows), j / rows
        theta, phi = math.pi * (1 - v), 2 * math.pi * u
        w = (math.sin(theta) * math.sin(phi), math.cos(theta), math.sin(theta) * math.cos(phi))
        r = radius(w)
        return (r * w[0], r * w[1], r * w[2], u, v)

    def material(corners):
        w = unit(*(sum(c[k] for c in corners) for k in range(3)))
        near = sorted((math.acos(max(-1, min(1, dot(w, s)))), k) for k, s in enumerate(seeds))[:2]
        return "gold" if near[1][0] - near[0][0] < 0.03 else f"enamel{near[0][1] % colours}"

    grid = [[corner(i, j) for i in range(2 * rows + 1)] for j in range(rows + 1)]
    faces = []
    for j in range(rows):
        for i in range(2 * rows):
            corners = [grid[j][i], grid[j][i + 1], grid[j + 1][i + 1], grid[j + 1][i]]
            if j == 0:
                corners = [corners[0], corners[2], corners[3]]
            elif j == rows - 1:
                corners = corners[:3]
            faces.append((material(corners), corners))
    write_obj(os.path.join(folder, "gargoyle.obj"), faces)
    enamel = ["0.05/0.15/0.5", "0.5/0.05/0.05", "0.05/0.4/0.15", "0.6/0.55/0.5", "0.05/0.35/0.4"]
    write_ini(os.path.join(folder, "gargoyle.ini"), "gargoyle.obj",
              [("gold", "ggx:rho_d=0.05/0.04/0.01,rho_s=0.8/0.6/0.25,alpha=0.2")] +
              [(f"enamel{k}", f"lambert:rho={enamel[k]}") for k in range(colours)],
              "[camera near]\neye = 1/1/9\nfov = 24\n[camera far]\neye = 4/4/36\nfov = 24\n",
              "[light lamp]\ntoward = -0.6/0.5/0.7\nintensity = 3\n[light sky]\nkind = environment\nintensity = 0.3\nvisible = 0\n")


# Each light is a sun; with the first one alone, pairs of directions lie on a sheet.
def ball(folder, lights=1, rows=48):
    columns = 2 * rows
    with open(os.path.join(folder, "ball.obj"), "w", encoding="ascii") as out:
        corners = [(math.sin(math.pi * j / rows) * math.cos(2 * math.pi * i / columns), math.cos(math.pi * j / rows),
                    math.sin(math.pi * j / rows) * math.sin(2 * math.pi * i / columns))
                   for j in range(rows + 1) for i in range(columns)]
        for letters in ("v", "vn"):
            out.writelines(f"{letters} {x:g} {y:g} {z:g}\n" for x, y, z in corners)
        for j in range(rows):
            for i in range(columns):
                a, b = j * columns + i + 1, j * columns + (i + 1) % columns + 1
                for face in ((a, b, b + columns), (a, b + columns, a + columns)):
                    if not (j == 0 and face[1] == b) and not (j == rows - 1 and face[1] != b):
                        out.write("f " + " ".join(f"{k}//{k}" for k in face) + "\n")
    suns = [("1/1/1", 3), ("-1/0.5/0.6", 1.5), ("0.2/-1/0.8", 1), ("-0.3/0.9/-0.4", 2)][:lights]
    for name, model in (("ward", "ward:rho_d=0.3,rho_s=0.2,alpha=0.15"), ("ggx", "ggx:rho_d=0.3,rho_s=0.2,alpha=0.05")):
        with open(os.path.join(folder, f"{name}.ini"), "w", encoding="ascii") as out:
            out.write("[image]\nwidth = 256\nheight = 256\nsamples = 16\n[camera front]\neye = 0/0/5\nfov = 26\n"
                      f"[material paint]\nmodel = {model}\n[mesh ball]\nfile = ball.obj\nmaterial = paint\n" +
                      "".join(f"[light sun{k}]\ntoward = {toward}\nintensity = {much}\n" for k, (toward, much) in enumerate(suns)))


def main():
    makers = {"ball": ball, "cylinder": cylinder, "bolt": bolt, "wall": wall, "gargoyle": gargoyle}
    if len(sys.argv) not in (3, 4) or sys.argv[1] not in makers:
        sys.exit(__doc__)
    os.makedirs(sys.argv[2], exist_ok=True)
    makers[sys.argv[1]](sys.argv[2], *([int(sys.argv[3])] if len(sys.argv) == 4 else []))


main()
