"""2D drawing to PNG and SVG: an oversampled sheet, fonts, colour scales."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path as File
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from planlang.outputs import MARK
from planlang.visible import visible

Colour = tuple[int, int, int]
Point = tuple[float, float]
Box = tuple[float, float, float, float]
"""Left, top, right, bottom."""
Path = Sequence[Point] | Sequence[float]
"""Points, or a flat sequence of their coordinates."""

FINE = 2
"""Oversampling: a sheet is drawn this many times larger and scaled down in the end, for smooth edges."""
PAPER, INK, FAINT = (255, 255, 255), (40, 40, 40), (120, 120, 120)


class Pen:
    """Draws on an image and records the same drawing as SVG; coordinates and widths are in pixels of the sheet."""

    def __init__(self, image: Image.Image) -> None:
        self._draw = ImageDraw.Draw(image)
        self.elements: list[str] = []

    def line(self, points: Path, fill: Colour, width: int = 1) -> None:
        """Draw a polyline."""
        self._draw.line(points, fill=fill, width=width)
        self.elements.append(f'<polyline points="{_listed(points)}" {_style(None, fill, width)}/>')

    def polygon(self, points: Path, fill: Colour, outline: Colour | None = None, width: int = 1) -> None:
        """Draw a polygon."""
        self._draw.polygon(points, fill=fill, outline=outline, width=width)
        self.elements.append(f'<polygon points="{_listed(points)}" {_style(fill, outline, width)}/>')

    def rectangle(
        self, box: Box, fill: Colour | None = None, outline: Colour | None = None, width: int = 1, radius: float = 0
    ) -> None:
        """Draw a rectangle, with rounded corners if ``radius`` is positive."""
        self._draw.rounded_rectangle(box, radius, fill=fill, outline=outline, width=width)
        left, top, right, bottom = box
        size = f'x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" height="{bottom - top:.1f}" rx="{radius:g}"'
        self.elements.append(f"<rect {size} {_style(fill, outline, width)}/>")

    def circle(
        self, at: Point, radius: float, fill: Colour | None = None, outline: Colour | None = None, width: int = 1
    ) -> None:
        """Draw a circle."""
        u, v = at
        self._draw.ellipse((u - radius, v - radius, u + radius, v + radius), fill=fill, outline=outline, width=width)
        place = f'cx="{u:.1f}" cy="{v:.1f}" r="{radius:.1f}"'
        self.elements.append(f"<circle {place} {_style(fill, outline, width)}/>")

    def text(self, at: Point, text: str, size: int, fill: Colour, anchor: str, *, halo: bool = False) -> None:
        """Draw a line of text; ``anchor`` is a text anchor of Pillow, ``halo`` adds a white border."""
        border_width = 2 * FINE if halo else 0
        self._draw.text(at, text, fill, font(size), anchor, stroke_width=border_width, stroke_fill=PAPER)
        across = {"l": "start", "m": "middle", "r": "end"}[anchor[0]]
        down = {"a": font(size).getmetrics()[0], "m": 0.3 * size * FINE, "s": 0.0}[anchor[1]]
        style = f'font-size="{size * FINE}" text-anchor="{across}" fill="{hex_of(fill)}"'
        border = f' paint-order="stroke" stroke="{hex_of(PAPER)}" stroke-width="{2 * border_width}"' if halo else ""
        shown = escape(visible(text))
        self.elements.append(f'<text x="{at[0]:.1f}" y="{at[1] + down:.1f}" {style}{border}>{shown}</text>')


def _listed(points: Path) -> str:
    flat = [value for one in points for value in (one if isinstance(one, tuple) else (one,))]
    return " ".join(f"{value:.1f}" for value in flat)


def _style(fill: Colour | None, outline: Colour | None, width: int) -> str:
    inside = f'fill="{hex_of(fill)}"' if fill else 'fill="none"'
    return f'{inside} stroke="{hex_of(outline)}" stroke-width="{width}"' if outline else inside


def hex_of(colour: Colour) -> str:
    """A colour as SVG and CSS have it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


class Sheet:
    """A white canvas. Its size and sizes of text are in pixels of the result, positions in oversampled pixels."""

    def __init__(self, width: float, height: float) -> None:
        self.image = Image.new("RGB", (round(width * FINE), round(height * FINE)), PAPER)
        self.pen = Pen(self.image)

    def finished(self) -> Image.Image:
        """Scale the drawing down to its final size."""
        width, height = self.image.size
        return self.image.resize((width // FINE, height // FINE), Image.Resampling.LANCZOS)

    def save(self, path: File) -> None:
        """Write a file: SVG if its suffix is .svg, else PNG. Raises OSError."""
        if path.suffix.lower() == ".svg":
            path.write_text(self.svg(), encoding="utf-8", newline="\n")
        else:
            self.finished().save(path, format="PNG")

    def svg(self) -> str:
        """The drawing as SVG."""
        width, height = self.image.size
        size = f'width="{width // FINE}" height="{height // FINE}" viewBox="0 0 {width} {height}"'
        head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif">'
        paper = f'<rect width="{width}" height="{height}" fill="{hex_of(PAPER)}"/>'
        return "\n".join([head, f"<!-- {MARK} -->", paper, *self.pen.elements, "</svg>", ""])

    def _repr_svg_(self) -> str:
        """The drawing, for notebooks."""
        return self.svg()

    def paste(self, other: Sheet, at: tuple[int, int], height: int | None = None) -> None:
        """Copy another sheet, or its upper ``height`` oversampled pixels, onto this one."""
        width, full_height = other.image.size
        height = full_height if height is None else height
        self.image.paste(other.image.crop((0, 0, width, height)), at)
        place = f'x="{at[0]}" y="{at[1]}" width="{width}" height="{height}"'
        self.pen.elements += [f"<svg {place}>", *other.pen.elements, "</svg>"]

    def picture(self, at: tuple[int, int], pixels: NDArray[np.uint8]) -> None:
        """Draw a picture (height, width, 3) with its upper left corner at a point."""
        image = Image.fromarray(pixels)
        width, height = image.width * FINE, image.height * FINE
        self.image.paste(image.resize((width, height), Image.Resampling.BICUBIC), at)
        content = BytesIO()
        image.save(content, format="PNG")
        source = f"data:image/png;base64,{base64.b64encode(content.getvalue()).decode('ascii')}"
        place = f'x="{at[0]}" y="{at[1]}" width="{width}" height="{height}"'
        self.pen.elements.append(f'<image {place} href="{source}"/>')

    def text(self, at: Point, text: str, size: int, colour: Colour = INK, anchor: str = "la") -> None:
        """Draw a line of text; ``anchor`` is a text anchor of Pillow."""
        self.pen.text(at, text, size, colour, anchor)

    def halo(self, at: Point, text: str, size: int, colour: Colour = INK) -> None:
        """Draw a line of text centred at a point, with a border that makes it legible on any background."""
        self.pen.text(at, text, size, colour, "mm", halo=True)

    def disc(self, at: Point, radius: float, *, fill: Colour | None = None, outline: Colour | None = None) -> None:
        """Draw a circle."""
        self.pen.circle(at, radius, fill, outline, FINE)

    def ring(self, at: Point, radius: float, colour: Colour, width: int = 1) -> None:
        """Draw the outline of a circle."""
        self.pen.circle(at, radius, None, colour, width * FINE)

    def scale(self, at: Point, size: Point, stops: Sequence[Colour]) -> None:
        """Draw the bar of a colour scale, low values on the left."""
        (left, top), (width, height) = at, size
        for column in range(round(width)):
            colour = blended(stops, column / max(width - 1, 1))
            self.pen.line((left + column, top, left + column, top + height), fill=colour)


def blended(stops: Sequence[Colour], share: float) -> Colour:
    """Interpolate a colour scale linearly between its stops; ``share`` is clamped to 0..1."""
    position = min(max(share, 0.0), 1.0) * (len(stops) - 1)
    first = min(int(position), len(stops) - 2)
    red, green, blue = (
        round(a + (b - a) * (position - first)) for a, b in zip(stops[first], stops[first + 1], strict=True)
    )
    return red, green, blue


def font(size: int) -> ImageFont.FreeTypeFont:
    """Font of a size in pixels of the result."""
    default = ImageFont.load_default(size * FINE)
    assert isinstance(default, ImageFont.FreeTypeFont)
    return default


def wrapped(text: str, size: int, width: float) -> list[str]:
    """Break a text between words into lines no wider than ``width`` oversampled pixels."""
    lines: list[str] = []
    for word in text.split(" "):
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and font(size).getlength(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines
