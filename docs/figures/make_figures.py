#!/usr/bin/env python3
"""Draws the figures of docs/method.md as SVG, with Python's standard library alone.

    docs/figures/make_figures.py [FOLDER]     default: the script's own folder

What is plotted is computed here from the formulas of docs/method.md, apart from the program; the seed is fixed, so the files
are the same every time (tests/test_docs.py compares them).
"""
import math
import pathlib
import random
import sys

INK, GREY, LIGHT = "#222222", "#888888", "#dddddd"
BLUE, RED, GREEN, ORANGE, PURPLE = "#2563a8", "#c0392b", "#2e8b57", "#d98200", "#7d3c98"
PALE_BLUE, PALE_ORANGE, PALE_GREEN = "#e3edf7", "#fbeeda", "#e2f2e8"


class Svg:
    def __init__(self, width, height):
        self.width, self.height, self.parts = width, height, []

    def add(self, text):
        self.parts.append(text)

    def line(self, points, color=INK, width=1.2, dash=None, arrow=False):
        points = list(points)
        if arrow:
            (x0, y0), (x1, y1) = points[-2:]
            length = math.hypot(x1 - x0, y1 - y0)
            dx, dy, size = (x1 - x0) / length, (y1 - y0) / length, 5 + 2 * width
            points[-1] = (x1 - 0.8 * size * dx, y1 - 0.8 * size * dy)
            self.area([(x1, y1), (x1 - size * dx - 0.45 * size * dy, y1 - size * dy + 0.45 * size * dx),
                       (x1 - size * dx + 0.45 * size * dy, y1 - size * dy - 0.45 * size * dx)], color)
        path = " ".join("%.1f,%.1f" % p for p in points)
        dashes = ' stroke-dasharray="%s"' % dash if dash else ""
        self.add('<polyline points="%s" fill="none" stroke="%s" stroke-width="%g"%s/>' % (path, color, width, dashes))

    def area(self, points, fill, color="none", width=1.0):
        path = " ".join("%.1f,%.1f" % p for p in points)
        self.add('<polygon points="%s" fill="%s" stroke="%s" stroke-width="%g"/>' % (path, fill, color, width))

    def box(self, x, y, w, h, fill, color=INK, radius=4):
        self.add('<rect x="%.1f" y="%.1f" width="%.1f" height="%.1f" rx="%g" fill="%s" stroke="%s"/>' % (x, y, w, h, radius, fill, color))

    def dot(self, x, y, color=INK, radius=3.0):
        self.add('<circle cx="%.1f" cy="%.1f" r="%g" fill="%s"/>' % (x, y, radius, color))

    def text(self, x, y, text, size=13, color=INK, anchor="middle", style=""):
        """_{..} becomes a subscript, *..* italics."""
        out, sub = "", False
        for piece in text.replace("_{", "\0").replace("}", "\1").split("\0"):
            head, _, tail = piece.partition("\1")
            if sub:
                out += '<tspan dy="%.1f" font-size="%g">%s</tspan><tspan dy="%.1f">%s</tspan>' % (0.25 * size, 0.75 * size, head, -0.25 * size, tail)
            else:
                out += head
            sub = True
        pieces = out.split("*")
        out = "".join('<tspan font-style="italic">%s</tspan>' % p if i % 2 else p for i, p in enumerate(pieces))
        self.add('<text x="%.1f" y="%.1f" font-size="%g" fill="%s" text-anchor="%s"%s>%s</text>' % (x, y, size, color, anchor, style, out))

    def write(self, path):
        head = ('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 %d %d" width="%d" height="%d" font-family="Helvetica, Arial, sans-serif">\n'
                '<rect width="%d" height="%d" fill="white"/>\n') % ((self.width, self.height) * 3)
        path.write_text(head + "\n".join(self.parts) + "\n</svg>\n")


class Plot:
    """Axes from (x0, y0), lower left in pixels, over the given ranges."""

    def __init__(self, svg, x0, y0, width, height, xs, ys, log2_x=False):
        self.svg, self.x0, self.y0, self.w, self.h, self.log2_x = svg, x0, y0, width, height, log2_x
        self.xs = (math.log2(xs[0]), math.log2(xs[1])) if log2_x else xs
        self.ys = ys
        svg.line([(x0, y0 - height), (x0, y0), (x0 + width, y0)])

    def at(self, x, y):
        x = math.log2(x) if self.log2_x else x
        return (self.x0 + (x - self.xs[0]) / (self.xs[1] - self.xs[0]) * self.w, self.y0 - (y - self.ys[0]) / (self.ys[1] - self.ys[0]) * self.h)

    def ticks(self, xs, ys, x_title, y_title, grid=True):
        for value, label in xs:
            x = self.at(value, self.ys[0])[0]
            self.svg.line([(x, self.y0), (x, self.y0 + 4)])
            self.svg.text(x, self.y0 + 17, label, 11)
        for value, label in ys:
            y = self.at(2.0 ** self.xs[0] if self.log2_x else self.xs[0], value)[1]
            if grid:
                self.svg.line([(self.x0, y), (self.x0 + self.w, y)], LIGHT, 0.7)
            self.svg.text(self.x0 - 6, y + 4, label, 11, anchor="end")
        self.svg.text(self.x0 + self.w / 2, self.y0 + 35, x_title, 12)
        self.svg.text(self.x0, self.y0 - self.h - 10, y_title, 12, anchor="start")

    def curve(self, points, color, width=1.8, dash=None):
        self.svg.line([self.at(x, y) for x, y in points], color, width, dash)


# Octahedral map (docs/method.md section 2)

def sign(a):
    return -1.0 if a < 0 else 1.0


def octa_project(v):
    s = sum(abs(a) for a in v)
    x, y, z = (a / s for a in v)
    return ((1 - abs(y)) * sign(x), (1 - abs(x)) * sign(y)) if z < 0 else (x, y)


def octa_unproject(u):
    x, y = u
    z = 1 - abs(x) - abs(y)
    if z < 0:
        x, y = (1 - abs(u[1])) * sign(u[0]), (1 - abs(u[0])) * sign(u[1])
    length = math.sqrt(x * x + y * y + z * z)
    return (x / length, y / length, z / length)


def triangles(resolution):
    """Of the map, as corners in [-1, 1]^2."""
    h = resolution // 2
    for j in range(-h, h):
        for i in range(-h, h):
            a, b, c, d = ((i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1))
            same = (i < 0) == (j < 0)
            pair = ((b, c, a), (b, c, d)) if same else ((a, d, b), (a, d, c))
            for t in pair:
                yield [(p[0] / h, p[1] / h) for p in t]


def octahedron(folder):
    svg = Svg(880, 340)
    resolution, h = 8, 4
    # The sphere, from a direction where +x, +y and +z are seen.
    ca, sa, cb, sb = math.cos(0.6), math.sin(0.6), math.cos(0.55), math.sin(0.55)

    def view(p):
        x, y, z = p
        right, back = -sa * x + ca * y, ca * x + sa * y
        return (right, cb * z - sb * back, sb * z + cb * back)

    def sphere(p):
        q = view(p)
        return (130 + 108 * q[0], 170 - 108 * q[1])

    for t in triangles(resolution):
        corners = [octa_unproject(u) for u in t]
        if sum(view(c)[2] for c in corners) < 0:
            continue
        upper = sum(abs(u[0]) + abs(u[1]) for u in t) / 3 < 1
        svg.area([sphere(c) for c in corners], PALE_BLUE if upper else PALE_ORANGE, GREY, 0.7)
    for name, p in (("+x", (1, 0, 0)), ("+y", (0, 1, 0)), ("+z", (0, 0, 1))):
        x, y = sphere(p)
        svg.dot(x, y, RED, 3.5)
        svg.text(x + 15, y - 7, "*%s*" % name, 13, RED)
    svg.text(130, 318, "(a) the sphere of directions, *R* = 8", 12)

    # The square.
    def square(u):
        return (430 + 128 * u[0], 165 - 128 * u[1])

    for t in triangles(resolution):
        upper = sum(abs(u[0]) + abs(u[1]) for u in t) / 3 < 1
        svg.area([square(u) for u in t], PALE_BLUE if upper else PALE_ORANGE, GREY, 0.7)
    for a, b in (((1, 0), (0, 1)), ((0, 1), (-1, 0)), ((-1, 0), (0, -1)), ((0, -1), (1, 0)), ((-1, 0), (1, 0)), ((0, -1), (0, 1))):
        svg.line([square(a), square(b)], INK, 1.4)
    for k, color in ((1, GREEN), (2, PURPLE), (3, BLUE)):
        for a in (k / h, -k / h):
            for u in ((1, a), (-1, a), (a, 1), (a, -1)):
                svg.dot(*square(u), color, 4)
    for u in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
        svg.dot(*square(u), ORANGE, 5)
    for name, u, dx, dy in (("+z", (0, 0), 14, -6), ("+x", (1, 0), 16, 4), ("−x", (-1, 0), -16, 4), ("+y", (0, 1), 0, -8), ("−y", (0, -1), 0, 18),
                            ("−z", (1, 1), 16, -4), ("−z", (-1, 1), -14, -4), ("−z", (1, -1), 16, 12), ("−z", (-1, -1), -14, 12)):
        x, y = square(u)
        if u in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)):
            svg.dot(x, y, RED, 3.5)
        svg.text(x + dx, y + dy, "*%s*" % name, 13, RED)
    svg.text(430, 332, "(b) unfolded; dots of one colour on one side are one vertex", 12)

    # The two kinds of cell.
    def cell(x0, y0, title, weights):
        size = 88
        svg.box(x0, y0, size, size, "white", INK, 0)
        anti = weights == "same"
        svg.line([(x0, y0), (x0 + size, y0 + size)] if anti else [(x0, y0 + size), (x0 + size, y0)])
        svg.text(x0 + size / 2, y0 - 10, title, 12)
        svg.text(x0 - 4, y0 + size + 14, "(*i*, *j*)", 11)
        svg.text(x0 + size + 6, y0 + size + 14, "(*i*+1, *j*)", 11)
        if anti:
            svg.text(x0 + 26, y0 + size - 14, "*s*+*t* ≤ 1", 11, BLUE)
            svg.text(x0 + size - 26, y0 + 24, "*s*+*t* > 1", 11, BLUE)
        else:
            svg.text(x0 + size - 24, y0 + size - 18, "*s* > *t*", 11, BLUE)
            svg.text(x0 + 24, y0 + 26, "*s* ≤ *t*", 11, BLUE)

    cell(680, 40, "*i*, *j* of different sign", "different")
    cell(680, 190, "*i*, *j* of the same sign", "same")
    svg.text(724, 318, "(c) diagonals of cells", 12)
    svg.write(folder / "octahedron.svg")


def lookup(folder):
    svg = Svg(720, 360)
    floor, x, y = 300, (300, 300), (575, 60)
    for i, fill in ((0, PALE_BLUE), (1, PALE_BLUE)):
        svg.box(150 + 150 * i, floor - 75, 150, 150 - 40, fill, GREY, 0)
    svg.line([(60, floor), (660, floor)], INK, 2)
    svg.line([(x[0], floor), (x[0], 150)], GREEN, 1.6, arrow=True)
    svg.text(x[0] - 12, 150, "*n*", 14, GREEN)
    dx, dy = y[0] - x[0], y[1] - x[1]
    length = math.hypot(dx, dy)
    eye = (x[0] - 230 * dx / length, x[1] + 230 * dy / length)
    svg.line([x, eye], BLUE, 1.8, arrow=True)
    svg.text(eye[0] - 8, eye[1] - 8, "*ω*_{o}, to the viewer", 14, BLUE)
    svg.line([x, y], RED, 1.2, dash="5 4")
    svg.line([x, (x[0] + 110 * dx / length, x[1] + 110 * dy / length)], RED, 2.2, arrow=True)
    svg.text(x[0] + 62, x[1] - 22, "*w* = *ω*_{r}", 14, RED)
    for k, c in enumerate(((225, 285), (375, 285))):
        svg.dot(*c, PURPLE, 4)
        svg.text(c[0] - 4, c[1] + 34, "*c*_{%d}" % (k + 1), 14, PURPLE)
        ex, ey = y[0] - c[0], y[1] - c[1]
        l = math.hypot(ex, ey)
        svg.line([c, y], PURPLE, 1, dash="2 4")
        svg.line([c, (c[0] + 95 * ex / l, c[1] + 95 * ey / l)], PURPLE, 2, arrow=True)
        svg.text(c[0] + 95 * ex / l + (26 if k else -14), c[1] + 95 * ey / l + (14 if k else -6), "*v*_{%d}" % (k + 1), 14, PURPLE)
    svg.dot(*x, INK, 4)
    svg.text(x[0] - 4, x[1] + 22, "*x*", 14)
    svg.dot(*y, RED, 5)
    svg.text(y[0] + 4, y[1] - 12, "*y* = *x* + *w* / *d*", 14, RED)
    svg.text(442, 158, "1 / *d*", 13, RED)
    svg.text(540, floor + 24, "cells of one level, centres *c*_{j}", 12, GREY)
    svg.text(590, 130, "*v*_{j} = (*x* − *c*_{j}) *d* + *w*", 14, PURPLE)
    svg.text(590, 150, "= *d* (*y* − *c*_{j})", 14, PURPLE)
    svg.write(folder / "lookup.svg")


def parallax(folder):
    """Left: where a cell is asked as the disparity grows. Right: what blending two cells makes of a reflected pattern."""
    svg = Svg(880, 370)

    def square(u):
        return (180 + 135 * u[0], 175 - 135 * u[1])

    svg.area([square(u) for u in ((-1, -1), (1, -1), (1, 1), (-1, 1))], "white", INK)
    svg.area([square(u) for u in ((1, 0), (0, 1), (-1, 0), (0, -1))], PALE_BLUE, GREY)
    w = (0.55, 0.25, 0.797)
    for delta, color in (((-0.9, 0.3, -0.5), ORANGE), ((0.2, 0.9, -0.7), GREEN), ((0.5, -0.8, 0.1), PURPLE)):
        path = []
        for k in range(401):
            d = math.tan(0.5 * math.pi * 0.985 * k / 400)
            path.append(octa_project(tuple(a + d * b for a, b in zip(w, delta))))
        segment = [square(path[0])]
        for a, b in zip(path, path[1:]):
            if math.hypot(a[0] - b[0], a[1] - b[1]) > 0.5:  # across the rim: the same direction elsewhere on the square
                svg.line(segment, color, 1.8)
                segment = []
            segment.append(square(b))
        svg.line(segment, color, 1.8, arrow=True)
    svg.dot(*square(octa_project(w)), RED, 4.5)
    x, y = square(octa_project(w))
    svg.text(x + 16, y - 8, "*d* = 0: *w*", 12, RED, anchor="start")
    svg.text(180, 335, "(a) path of *u* over the map while *d* grows,", 12)
    svg.text(180, 351, "for three offsets *x* − *c*_{j}", 12)

    # A striped ceiling at height 2 over a floor with cells of size 1; the mirror direction is straight up everywhere.
    height, edge = 2.0, 1.0

    def stripes(at):
        return 1.0 if (at + 10.0) % 0.62 < 0.27 else 0.15

    def blended(at, disparity):
        """Two cells, each with what its centre sees along v = ((at - centre) d, 1)."""
        base = math.floor(at / edge - 0.5)
        f = at / edge - 0.5 - base
        value = 0.0
        for k, weight in ((0, 1 - f), (1, f)):
            centre = (base + k + 0.5) * edge
            value += weight * stripes(centre + height * (at - centre) * disparity)
        return value

    rows = ((1 / height, "*d* = 1/2, which is 1 / height", GREEN), (0.45, "*d* = 0.45", ORANGE), (0.0, "*d* = 0: no offset", RED))
    for r, (disparity, label, color) in enumerate(rows):
        plot = Plot(svg, 420, 105 + 95 * r, 420, 55, (-2.0, 2.0), (0, 1.05))
        grid = [-2.0 + 4.0 * k / 500 for k in range(501)]
        plot.curve([(x, stripes(x)) for x in grid], LIGHT, 3)
        plot.curve([(x, blended(x, disparity)) for x in grid], color, 1.5)
        svg.text(424, 105 + 95 * r - 62, label, 12, color, anchor="start")
        for centre in (-1.5, -0.5, 0.5, 1.5):
            svg.dot(*plot.at(centre, 0), PURPLE, 3.5)
    svg.text(630, 335, "(b) reflection of a striped ceiling along a floor: two cells (dots: their", 12)
    svg.text(630, 351, "centres) blended, with what each centre sees; grey: the truth", 12)
    svg.write(folder / "parallax.svg")


PAPER_CELLS = (56, 314, 1585, 7118, 30690, 127314, 583036, 2471679)


def entries(levels):
    return [cells * (2 ** (levels + 1 - l) + 1) ** 2 for l, cells in enumerate(PAPER_CELLS[:levels], 1)]


def level_table(folder):
    svg = Svg(880, 310)
    plot = Plot(svg, 60, 240, 330, 190, (0.5, 8.5), (0, 10))
    plot.ticks([(l, str(l)) for l in range(1, 9)], [(k, str(2 ** k)) for k in range(0, 11, 2)], "level *l* of *K* = 8", "resolution")
    plot.curve([(l, l + 1) for l in range(1, 9)], BLUE)
    plot.curve([(l, 9 - l) for l in range(1, 9)], RED)
    for l in range(1, 9):
        svg.dot(*plot.at(l, l + 1), BLUE)
        svg.dot(*plot.at(l, 9 - l), RED)
    svg.text(352, 58, "cells an axis, 2^{l+1}".replace("^{l+1}", "<tspan dy='-5' font-size='9'>l+1</tspan>"), 12, BLUE)
    svg.text(310, 160, "octahedral map, *R*_{l}", 12, RED)
    plot = Plot(svg, 500, 240, 330, 190, (0.5, 8.5), (0, 25))
    plot.ticks([(l, str(l)) for l in range(1, 9)], [(k, str(k)) for k in range(0, 26, 5)], "level *l*", "million entries (the paper's bathroom, *K* = 8)")
    assert sum(entries(8)) == 79375000 and sum(entries(5)) == 734275 and sum(entries(6)) == 3526245
    for l, count in enumerate(entries(8), 1):
        x, y = plot.at(l, count / 1e6)
        svg.box(x - 13, y, 26, 240 - y, PALE_GREEN, GREEN, 0)
        svg.text(x, y - 5, "%.1f" % (count / 1e6), 10)
    svg.write(folder / "levels.svg")


def step(folder):
    svg = Svg(900, 330)

    def box(x, y, w, lines, fill):
        svg.box(x, y, w, 20 + 16 * len(lines), fill)
        for k, line in enumerate(lines):
            svg.text(x + w / 2, y + 22 + 16 * k, line, 12)

    box(15, 110, 150, ("left-hand-side points", "walks, area, view:", "*N* × (*x*, *ω*_{o}, *n*, *a*, *α*)"), PALE_BLUE)
    box(210, 15, 165, ("*M* emitter samples", "*M* BSDF samples", "through mirrors and glass"), PALE_ORANGE)
    box(425, 15, 150, ("query the field at", "the ends of the rays,", "detached"), PALE_GREEN)
    box(630, 15, 110, ("target *T*", "(MIS, mean of *M*)"), PALE_ORANGE)
    box(210, 205, 165, ("disparity *g*_{ψ}: hash grid,", "harmonics of *w*, MLP"), PALE_GREEN)
    box(425, 205, 150, ("OctaOctree query", "*K* levels × *C* features"), PALE_GREEN)
    box(630, 205, 110, ("decoder *f*_{φ}", "prediction *L̂*"), PALE_GREEN)
    box(785, 110, 100, ("loss", "relative", "squared"), "#f6e3e1")
    arrows = (((165, 130), (188, 130), (188, 48), (210, 48)), ((375, 48), (425, 48)), ((575, 48), (630, 48)), ((740, 48), (835, 48), (835, 110)),
              ((165, 155), (188, 155), (188, 222), (210, 222)), ((375, 222), (425, 222)), ((575, 222), (630, 222)), ((740, 222), (835, 222), (835, 178)))
    for points in arrows:
        svg.line(points, INK, 1.4, arrow=True)
    for points in (((850, 178), (850, 246), (740, 246)), ((630, 246), (575, 246)), ((425, 246), (375, 246))):
        svg.line(points, RED, 1.4, dash="5 3", arrow=True)
    svg.line([(292, 257), (292, 292)], RED, 1.4, dash="5 3", arrow=True)
    svg.line([(500, 257), (500, 292)], RED, 1.4, dash="5 3", arrow=True)
    svg.line([(685, 257), (685, 292)], RED, 1.4, dash="5 3", arrow=True)
    svg.text(488, 310, "Adam: networks, touched entries of the tables", 12, RED)
    svg.line([(685, 205), (685, 140), (500, 140), (500, 83)], GREY, 1.2, dash="2 3", arrow=True)
    svg.text(592, 132, "same weights", 11, GREY)
    svg.write(folder / "step.svg")


FORMS = {  # expected gradient, up to a positive factor, for epsilon = 0 (docs/method.md section 7)
    "prediction": lambda t, p: p - t,
    "symmetric": lambda t, p: (p - t) / (p + t) ** 2,
    "symmetric, not detached": lambda t, p: t * (p - t) / (p + t) ** 3,
    "prediction, not detached": lambda t, p: t * (p - t),
}


def stationary(form, targets):
    """Where the mean gradient is 0, relative to the mean of the targets."""
    low, high = 0.02, 20.0
    for _ in range(40):
        middle = math.sqrt(low * high)
        if sum(FORMS[form](t, middle) for t in targets) < 0:
            low = middle
        else:
            high = middle
    return math.sqrt(low * high)


def noisy_targets(directions, rng):
    """Means of log-normal estimates of mean 1 and standard deviation 3, scaled so that their own mean is 1."""
    sigma = math.sqrt(math.log(10.0))
    targets = [sum(rng.lognormvariate(-sigma * sigma / 2, sigma) for _ in range(directions)) / directions for _ in range(max(1500, 60000 // directions))]
    mean = sum(targets) / len(targets)
    return [t / mean for t in targets]


def loss_bias(folder):
    rng = random.Random(1)
    counts = [2 ** k for k in range(1, 10)]
    points = {form: [] for form in FORMS}
    for directions in counts:
        targets = noisy_targets(directions, rng)
        for form in FORMS:
            points[form].append((directions, stationary(form, targets)))
    svg = Svg(880, 340)
    plot = Plot(svg, 60, 270, 340, 210, (2, 512), (0, 1.6), log2_x=True)
    plot.ticks([(m, str(m)) for m in counts], [(k / 5, "%.1f" % (k / 5)) for k in range(0, 9)], "directions *M* of a target", "stationary prediction / true mean")
    plot.curve([(m, max(0.0, 1 - 9 / m)) for m in counts if m >= 9], RED, 1, dash="3 3")
    for form, color in (("prediction", GREEN), ("symmetric", RED), ("symmetric, not detached", ORANGE), ("prediction, not detached", PURPLE)):
        plot.curve([p for p in points[form] if p[1] <= 1.6], color)
    x = 410
    for y, text, color in ((66, "prediction, not detached", PURPLE), (126, "prediction", GREEN), (190, "symmetric, not detached", ORANGE), (210, "symmetric", RED),
                           (238, "1 − Var *T*, first order", RED)):
        svg.text(x - 14, y, text, 11, color, anchor="end")
    plot = Plot(svg, 520, 270, 320, 210, (0, 0.95), (0, 1.05))
    plot.ticks([(k / 5, "%.1f" % (k / 5)) for k in range(5)], [(k / 5, "%.1f" % (k / 5)) for k in range(6)], "share of light that a bounce returns, *ρ*",
               "brightness of the cache / truth, symmetric form")
    symmetric = dict(points["symmetric"])
    for m, color in ((8, RED), (32, ORANGE), (256, BLUE)):
        q = symmetric[m]
        curve = [(k / 200, q * (1 - k / 200) / (1 - q * k / 200)) for k in range(191)]
        plot.curve(curve, color)
        px, py = plot.at(*curve[4])
        svg.text(px + 6, py - 6, "*M* = %d (%.3f)" % (m, q), 11, color, anchor="start")
    svg.write(folder / "loss_bias.svg")
    return points


def schedule(folder):
    svg = Svg(880, 300)
    plot = Plot(svg, 60, 230, 330, 180, (0, 1), (4, 17))
    plot.ticks([(k / 4, "%g" % (k / 4)) for k in range(5)], [(k, "%d" % 2 ** k if k < 10 else "%dk" % 2 ** (k - 10)) for k in range(4, 18, 3)],
               "share of the budget", "*N* points, *M* directions; paper: dashed")
    for first, step_, color, name, dash in ((13, 1, BLUE, "*N*, default", None), (16, -1, BLUE, "*N*, paper", "4 3"), (5, 0, RED, "*M*, default", None), (5, 1, RED, "", "4 3")):
        curve = []
        for quarter in range(4):
            curve += [(quarter / 4, first + step_ * quarter), ((quarter + 1) / 4, first + step_ * quarter)]
        plot.curve(curve, color, dash=dash)
        px, py = plot.at(0.02, first)
        svg.text(px, py - 6, name, 12, color, anchor="start")
    plot = Plot(svg, 500, 230, 330, 180, (0, 1), (0, 1.05))
    plot.ticks([(k / 4, "%g" % (k / 4)) for k in range(5)], [(k / 5, "%.1f" % (k / 5)) for k in range(6)], "share of the budget",
               "learning rate / largest; *ε* of the loss × 10")

    def rate(f):
        return 1.0 if f <= 0.3 else 0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * (f - 0.3) / 0.7))

    plot.curve([(k / 400, rate(k / 400)) for k in range(401)], BLUE)
    plot.curve([(0, 1), (1, 1)], GREY, 1.2, dash="4 3")
    curve = []
    for quarter in range(4):
        epsilon = 10 * 0.1 * (0.0125 / 0.1) ** (quarter / 3)
        curve += [(quarter / 4, epsilon), ((quarter + 1) / 4, epsilon)]
    plot.curve(curve, RED)
    svg.text(735, 105, "rate: default, cpu", 11, BLUE, anchor="start")
    svg.text(735, 72, "rate: paper", 11, GREY, anchor="start")
    svg.text(620, 140, "10 *ε*", 12, RED)
    svg.write(folder / "schedule.svg")


def main():
    folder = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parent
    octahedron(folder)
    lookup(folder)
    parallax(folder)
    level_table(folder)
    step(folder)
    schedule(folder)
    for form, values in loss_bias(folder).items():
        print("%-26s" % form, "  ".join("M=%d %.3f" % value for value in values))


if __name__ == "__main__":
    main()
