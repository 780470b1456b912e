#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Draws the cameras of docs/cameras.md: draw_cameras.py FOLDER writes camera-NAME.svg there.

One scene for all: the source on the left, the beam to the right, the detector seen obliquely, its far edge up and to the
right. Along the beam, a camera that is not mirrored has columns towards the reader and rows downwards.
"""
import sys
from html import escape

SOURCE = (150, 205)
FAR, NEAR = 620, 545  # x of the detector's edges
TOP, SHIFT, HEIGHT = 60, 55, 240
CORNERS = {
    "far top": (FAR, TOP),
    "near top": (NEAR, TOP + SHIFT),
    "near bottom": (NEAR, TOP + SHIFT + HEIGHT),
    "far bottom": (FAR, TOP + HEIGHT),
}
FOOT = ((FAR + NEAR) / 2, TOP + (SHIFT + HEIGHT) / 2)
# Directions in the drawing: of the beam, down, and towards the reader.
BEAM, DOWN, NEARER = (1.0, 0.0), (0.0, 1.0), (-0.75, 0.55)
BLUE, RED, GREEN, GREY = "#1d4e89", "#9c2c2c", "#0b6e4f", "#555555"


def minus(direction):
    return (-direction[0], -direction[1])


class Drawing:
    def __init__(self, width=1010, height=380):
        self.parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
            'font-family="DejaVu Sans, sans-serif" font-size="14">',
            f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
        ]

    def path(self, points, color, width=1.5, dashes="", fill="none"):
        line = " L".join(f"{x:.0f} {y:.0f}" for x, y in points)
        dashed = f' stroke-dasharray="{dashes}"' if dashes else ""
        self.parts.append(f'<path d="M{line}" stroke="{color}" stroke-width="{width}" fill="{fill}"{dashed}/>')

    def text(self, x, y, text, color=GREY, anchor="start"):
        self.parts.append(f'<text x="{x:.0f}" y="{y:.0f}" fill="{color}" text-anchor="{anchor}">{escape(text, quote=False)}</text>')

    def dot(self, at, color, radius=5):
        self.parts.append(f'<circle cx="{at[0]:.0f}" cy="{at[1]:.0f}" r="{radius}" fill="{color}"/>')

    def arrow(self, start, direction, length, label, color, width=2.0):
        norm = (direction[0] ** 2 + direction[1] ** 2) ** 0.5
        ux, uy = direction[0] / norm, direction[1] / norm
        end = (start[0] + length * ux, start[1] + length * uy)
        back = (end[0] - 11 * ux, end[1] - 11 * uy)
        self.path([start, end], color, width)
        self.path([(back[0] - 5 * uy, back[1] + 5 * ux), end, (back[0] + 5 * uy, back[1] - 5 * ux)], color, width)
        anchor = "end" if ux < -0.4 else "start"
        self.text(end[0] + (-7 if anchor == "end" else 7), end[1] + (16 if uy > 0.4 else -4), label, color, anchor)

    def scene(self, source, origin, column, row, isocenter="isocentre"):
        """`origin`: the corner of pixel (0, 0); `column`, `row`: directions in the drawing and labels."""
        self.path([CORNERS[name] for name in CORNERS] + [CORNERS["far top"]], BLUE, fill="#dce8f5")
        for corner in CORNERS.values():
            self.path([SOURCE, corner], BLUE, 1.0, "5 4")
        self.path([SOURCE, FOOT], GREY, 1.0, "2 3")
        self.dot(SOURCE, BLUE, 6)
        self.text(SOURCE[0], SOURCE[1] + 92, source, BLUE, "middle")
        if isocenter:
            at = (370, SOURCE[1] + (FOOT[1] - SOURCE[1]) * (370 - SOURCE[0]) / (FOOT[0] - SOURCE[0]))
            self.dot(at, RED, 4)
            self.text(at[0] + 6, at[1] + 20, isocenter, RED)
        start = CORNERS[origin]
        self.arrow(start, column[0], 62, column[1], BLUE)
        self.arrow(start, row[0], 90, row[1], BLUE)
        self.dot(start, BLUE, 4)
        self.text(start[0] + 12, start[1] + (-8 if "top" in origin else 22), "(0, 0)", BLUE)

    def axes(self, at, arrows, color):
        for direction, label, length in arrows:
            self.arrow(at, direction, length, label, color)

    def lines(self, texts, x=745, y=130):
        for i, text in enumerate(texts):
            self.text(x, y + 24 * i, text)

    def save(self, folder, name):
        with open(f"{folder}/camera-{name}.svg", "w", encoding="utf-8") as file:
            file.write("\n".join(self.parts) + "\n</svg>\n")


COLUMN, ROW = (NEARER, "column"), (DOWN, "row")


def project(folder):
    drawing = Drawing()
    drawing.scene("source", "far top", (NEARER, "column_direction"), (DOWN, "row_direction"))
    drawing.arrow(SOURCE, BEAM, 110, "beam = column x row", BLUE)
    drawing.lines(["pixel (c, r) is at", "detector_origin_point", "+ c spacing_x column_direction",
                   "+ r spacing_y row_direction"])
    drawing.save(folder, "project")


def mayacam2(folder):
    drawing = Drawing()
    drawing.scene("x_camera = R x + t", "far top", COLUMN, ROW)
    drawing.axes(SOURCE, [(NEARER, "x", 55), (BEAM, "z: beam", 110)], GREEN)
    drawing.arrow(SOURCE, DOWN, 62, "", GREEN)
    drawing.text(SOURCE[0] + 8, SOURCE[1] + 60, "y", GREEN)
    drawing.lines(["column = c_x + f_x x / z", "row = c_y + f_y y / z"])
    drawing.save(folder, "mayacam2")


def mayacam1(folder):
    drawing = Drawing()
    drawing.scene("line 1: source", "far top", COLUMN, ROW)
    drawing.axes(SOURCE, [(NEARER, "x", 55), (minus(DOWN), "y: up", 70), (minus(BEAM), "z: away", 60)], GREEN)
    drawing.lines(["room from camera = Rz Ry Rx", "line 4: u0, v0 count from 1,", "v0 from the lowest row up"])
    drawing.save(folder, "mayacam1")


def rtk(folder):
    drawing = Drawing()
    drawing.scene("source, z = SID", "far bottom", (NEARER, "u: columns"), (minus(DOWN), "v: rows"),
                  "isocentre, origin")
    at = (370, 206)
    drawing.axes(at, [(minus(BEAM), "z", 70), (minus(DOWN), "y: axis of rotation", 75), (NEARER, "x", 50)], RED)
    drawing.lines(["detector at z = SID - SDD", "gantry angle 0", "row 0 is the lowest:", "mirrored"])
    drawing.save(folder, "rtk")


def plastimatch(folder):
    drawing = Drawing()
    drawing.scene("isocentre + SAD nrm", "far top", (NEARER, "column = beam x vup"), (DOWN, "row"), "isocentre (-o)")
    drawing.arrow((370, 206), minus(BEAM), 95, "nrm", RED)
    drawing.arrow((370, 206), minus(DOWN), 75, "vup", RED)
    drawing.lines(["detector SID from the source;", "the isocentre is seen at", "the image centre (-c)"])
    drawing.save(folder, "plastimatch")


def elastix(folder):
    drawing = Drawing()
    drawing.scene("FocalPoint", "far top", (NEARER, "Direction[0..2]"), (DOWN, "Direction[3..5]"), "")
    drawing.lines(["(0, 0) is at Origin;", "columns are Spacing[0],", "rows Spacing[1] apart"])
    drawing.save(folder, "elastix")


def dicom(folder):
    drawing = Drawing()
    drawing.scene("source, behind the back", "near top", (minus(NEARER), "column: L"), (DOWN, "row: F"),
                  "isocentre, origin")
    at = (370, 206)
    drawing.axes(at, [(BEAM, "A: angles 0, 0", 70), (minus(NEARER), "L: +primary (LAO)", 60),
                      (minus(DOWN), "H: +secondary (CRA)", 80)], RED)
    drawing.lines(["seen from the detector,", "head on top: mirrored;", "PatientOrientation decides"])
    drawing.save(folder, "dicom")


def xreg(folder):
    drawing = Drawing()
    drawing.scene("source", "near top", (minus(NEARER), "column: x"), (DOWN, "row: y"), "")
    drawing.axes(SOURCE, [(minus(BEAM), "z", 60), (minus(NEARER), "x", 50)], GREEN)
    drawing.arrow(SOURCE, DOWN, 62, "", GREEN)
    drawing.text(SOURCE[0] + 8, SOURCE[1] + 60, "y", GREEN)
    drawing.text(30, 340, "origin-at-focal-pt-det-neg-z, DeepFluoro:", GREEN)
    drawing.text(30, 362, "the detector is at z = -focal length: mirrored", GREEN)
    drawing.lines(["...-pos-z: z points along the", "beam, x or y the other way", "", "origin-on-det: this frame,",
                   "at the detector; the source", "is at z = focal length"])
    drawing.save(folder, "xreg")


def rad(folder):
    drawing = Drawing()
    drawing.scene("SourcePosition", "near top", (minus(NEARER), "x: columns"), (DOWN, "y: rows"), "")
    drawing.arrow(CORNERS["near top"], minus(BEAM), 75, "z: to the source", BLUE)
    drawing.lines(["TPosition: world from", "this frame, whose origin", "is pixel (0, 0): mirrored"])
    drawing.save(folder, "rad")


def diffdrr(folder):
    drawing = Drawing()
    drawing.scene("source", "far top", COLUMN, ROW, "middle of the volume")
    drawing.axes(SOURCE, [(minus(NEARER), "x", 50), (minus(DOWN), "y", 70), (BEAM, "z: beam, sdd", 90)], GREEN)
    drawing.dot((FOOT[0] - 12, FOOT[1] - 18), GREEN, 4)
    drawing.text(FOOT[0] - 2, FOOT[1] - 22, "(x0, y0)", GREEN)
    drawing.lines(["x against the columns, y against the", "rows; the detector's middle is at", "(x0, y0, sdd)"])
    drawing.save(folder, "diffdrr")


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: draw_cameras.py FOLDER")
    for draw in (project, mayacam2, mayacam1, rtk, plastimatch, elastix, dicom, xreg, rad, diffdrr):
        draw(sys.argv[1])


if __name__ == "__main__":
    main()
