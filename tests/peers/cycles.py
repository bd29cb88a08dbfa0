# SPDX-License-Identifier: BSD-3-Clause
"""Cycles, Blender's path tracer, as a goniometer and as a camera. Run inside Blender:

    blender -b --factory-startup -P cycles.py -- measure MATERIAL DIRECTIONS.csv OUT.csv
    blender -b --factory-startup -P cycles.py -- picture SCENE.json SPHERE PLATE OUT.pfm

MATERIAL, SPHERE, PLATE: a script that makes `material` (gonio convert --to principled), or a glTF file. A sun has the
irradiance 1 across its beam and there is no bounce, so that a plane's radiance is f_r cos(theta_i); it is read from
32-bit pixels. SCENE.json is scene.py's."""
import csv
import json
import math
import os
import struct
import sys

import bpy
import mathutils


def material_of(path):
    if path.endswith(".gltf"):
        import numpy

        numpy.bool = bool  # Blender 3.4's importer asks for it, numpy 1.24 no longer has it
        before = set(bpy.data.materials)
        bpy.ops.import_scene.gltf(filepath=path)
        made = [m for m in bpy.data.materials if m not in before]
        for thing in list(bpy.context.selected_objects):
            bpy.data.objects.remove(thing)
        return made[0]
    names = {}
    with open(path) as script:
        exec(compile(script.read(), path, "exec"), names)
    return names["material"]


def direction(theta_deg, phi_deg):
    theta, phi = math.radians(theta_deg), math.radians(phi_deg)
    return mathutils.Vector((math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)))


def add(name, data):
    thing = bpy.data.objects.new(name, data)
    thing.rotation_mode = "QUATERNION"
    bpy.context.scene.collection.objects.link(thing)
    return thing


def begin(width, samples):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = samples
    scene.cycles.max_bounces = 0
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.pixel_filter_type = "BOX"
    scene.view_settings.view_transform = "Raw"
    scene.render.resolution_x = scene.render.resolution_y = width
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    return scene


def sun_at(toward, irradiance):
    data = bpy.data.lights.new("sun", "SUN")
    data.energy, data.angle = irradiance, 0
    sun = add("sun", data)
    sun.rotation_quaternion = mathutils.Vector(toward).to_track_quat("Z", "Y")
    return sun


def measure(path, directions, out):
    scene = begin(4, 4)
    bpy.ops.mesh.primitive_plane_add(size=2)  # its texture coordinate u runs along x
    plane = bpy.context.object
    material = material_of(path)
    plane.data.materials.append(material)
    sun = sun_at((0, 0, 1), 1)
    view = bpy.data.cameras.new("eye")
    view.type, view.ortho_scale = "ORTHO", 0.1
    scene.camera = eye = add("eye", view)
    scene.render.filepath = out + ".exr"
    with open(directions) as rows, open(out, "w") as to:
        to.write("theta_i,phi_i,theta_o,phi_o,r,g,b\n")
        for row in csv.DictReader(rows):
            angles = [float(row[k]) for k in ("theta_i", "phi_i", "theta_o", "phi_o")]
            sun.rotation_quaternion = direction(*angles[:2]).to_track_quat("Z", "Y")
            eye.location = 5 * direction(*angles[2:])
            eye.rotation_quaternion = eye.location.to_track_quat("Z", "Y")
            bpy.ops.render.render(write_still=True)
            image = bpy.data.images.load(scene.render.filepath)
            pixels = list(image.pixels)
            bpy.data.images.remove(image)
            cosine = math.cos(math.radians(angles[0]))
            values = [sum(pixels[c::4]) / (len(pixels) // 4) / cosine for c in range(3)]
            to.write(",".join(f"{v:.9g}" for v in angles + values) + "\n")
    os.remove(scene.render.filepath)


def turned(v):
    """Blender's z is up."""
    return (v[0], -v[2], v[1])


def sky(low, rise):
    """The environment's light, low + rise y a channel, y the part of the direction that points up."""
    world = bpy.data.worlds.new("sky")
    bpy.context.scene.world = world
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    where, parts, joined = (nodes.new("ShaderNode" + n) for n in ("TexCoord", "SeparateXYZ", "CombineXYZ"))
    links.new(where.outputs["Generated"], parts.inputs[0])
    for c in range(3):
        node = nodes.new("ShaderNodeMath")
        node.operation = "MULTIPLY_ADD"
        links.new(parts.outputs["Z"], node.inputs[0])
        node.inputs[1].default_value, node.inputs[2].default_value = rise[c], low[c]
        links.new(node.outputs[0], joined.inputs[c])
    links.new(joined.outputs[0], nodes["Background"].inputs["Color"])


def picture(path, sphere, plate, out):
    with open(path) as file:
        s = json.load(file)
    scene = begin(s["size"], 256)
    for name, made_by in (("sphere", sphere), ("plate", plate)):
        bpy.ops.wm.obj_import(filepath=os.path.join(os.path.dirname(path), name + ".obj"), forward_axis="NEGATIVE_Z", up_axis="Y")
        shape = bpy.context.selected_objects[0]
        shape.data.materials.clear()
        shape.data.materials.append(material_of(made_by))
    sun_at(turned(s["toward"]), s["irradiance"])
    sky(s["low"], s["rise"])
    view = bpy.data.cameras.new("eye")
    view.angle = math.radians(s["fov"])
    scene.camera = eye = add("eye", view)
    eye.location = turned(s["eye"])
    eye.rotation_quaternion = eye.location.to_track_quat("Z", "Y")
    scene.render.film_transparent = False
    scene.render.filepath = out + ".exr"
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = list(image.pixels)  # red, green, blue, alpha, from the lowest row up, as in a PFM
    with open(out, "wb") as file:
        file.write(b"PF\n%d %d\n-1.0\n" % tuple(image.size))
        for k in range(0, len(pixels), 4):
            file.write(struct.pack("<3f", *pixels[k : k + 3]))
    os.remove(scene.render.filepath)


arguments = sys.argv[sys.argv.index("--") + 1 :]
{"measure": measure, "picture": picture}[arguments[0]](*[a if a.startswith("/") else os.path.abspath(a) for a in arguments[1:]])
