#!/usr/bin/env python3
"""Copies a scene without what nobody can see of its lamps: the inner walls of hollow ones, and emitters that lie within others.

    bench/without_insides.py SCENE_FOLDER NEW_FOLDER

The paper's bathroom has bulbs with walls of a twentieth of a millimetre, which emit on both sides, reflect everything and are closed. Directions about
smooth normals lead through such walls now and then, in Mitsuba as here, and come back with the light of hundreds of bounces: 6 % of the light of its
picture (docs/results.md). Of Wavefront OBJ shapes with an emitter, connected parts that face inwards are left out, and shapes whose bounds lie within
those of another such shape. All other files are links to those of SCENE_FOLDER.
"""
import os
import pathlib
import sys
import xml.etree.ElementTree


def read_obj(path):
    """-> lines, positions, faces as (line number, indices of positions)"""
    lines, positions, faces = path.read_text().split("\n"), [], []
    for number, line in enumerate(lines):
        words = line.split()
        if words[:1] == ["v"]:
            positions.append(tuple(float(word) for word in words[1:4]))
        elif words[:1] == ["f"]:
            indices = [int(word.split("/")[0]) for word in words[1:]]
            faces.append((number, [i - 1 if i > 0 else len(positions) + i for i in indices]))
    return lines, positions, faces


def connected_parts(positions, faces):
    """Faces by the part that they belong to; vertices at the same place, to 1e-5, are one."""
    places = {}
    root = list(range(len(positions)))

    def find(i):
        while root[i] != i:
            root[i] = root[root[i]]
            i = root[i]
        return i

    for i, p in enumerate(positions):
        root[i] = places.setdefault(tuple(round(x, 5) for x in p), i)
    for _, indices in faces:
        for i in indices[1:]:
            root[find(indices[0])] = find(i)
    parts = {}
    for face in faces:
        parts.setdefault(find(face[1][0]), []).append(face)
    return list(parts.values())


def signed_volume(positions, faces):
    """Six times the volume that the faces enclose; negative where they face inwards."""
    total = 0.0
    for _, indices in faces:
        a = positions[indices[0]]
        for j, k in zip(indices[1:], indices[2:]):
            b, c = positions[j], positions[k]
            total += a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    return total


def bounds(positions):
    return tuple(min(p[k] for p in positions) for k in range(3)), tuple(max(p[k] for p in positions) for k in range(3))


def within(inner, outer):
    return all(a > b for a, b in zip(inner[0], outer[0])) and all(a < b for a, b in zip(inner[1], outer[1]))


def link_all(source, target, changed):
    for folder, _, names in os.walk(source):
        to = target / pathlib.Path(folder).relative_to(source)
        to.mkdir(parents=True, exist_ok=True)
        for name in names:
            file = pathlib.Path(folder) / name
            if file not in changed:
                (to / name).symlink_to(file)


def main(source, target):
    if target.exists():
        sys.exit("%s is there already" % target)
    scene = xml.etree.ElementTree.parse(source / "scene.xml")
    lamps = {}  # shape -> file, and what read_obj() gives
    for shape in scene.getroot().findall("shape"):
        if shape.get("type") == "obj" and shape.find("emitter") is not None:
            file = source / shape.find("string[@name='filename']").get("value")
            lamps[shape] = (file, *read_obj(file))
    sizes = {shape: bounds(lamp[2]) for shape, lamp in lamps.items()}
    texts = {}
    for shape, (file, lines, positions, faces) in lamps.items():
        if any(within(sizes[shape], other) for other in sizes.values()):
            scene.getroot().remove(shape)
            print("%s: within another lamp, left out" % file.name)
            continue
        inner = [face for part in connected_parts(positions, faces) if signed_volume(positions, part) < 0 for face in part]
        if inner:
            dropped = {number for number, _ in inner}
            texts[file] = "\n".join(line for number, line in enumerate(lines) if number not in dropped)
            print("%s: %d of %d faces are an inner wall, left out" % (file.name, len(inner), len(faces)))
    link_all(source, target, {*texts, source / "scene.xml"})
    for file, text in texts.items():
        (target / file.relative_to(source)).write_text(text)
    scene.write(target / "scene.xml")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve())
