"""Tools for pictures: a sheet that is made smaller at the end, fonts, colour scales."""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image, ImageDraw, ImageFont

Colour = tuple[int, int, int]
Point = tuple[float, float]

FINE = 2
"""Everything is drawn so many times larger, then made smaller: smooth edges."""
PAPER, INK, FAINT = (255, 255, 255), (40, 40, 40), (120, 120, 120)


class Sheet:
    """A white picture of so many pixels; sizes of text and lines are in pixels of the result, places are not."""

    def __init__(self, width: float, height: float) -> None:
        self.image = Image.new("RGB", (round(width * FINE), round(height * FINE)), PAPER)
        self.pen = ImageDraw.Draw(self.image)

    def finished(self) -> Image.Image:
        """Return the picture in its size."""
        width, height = self.image.size
        return self.image.resize((width // FINE, height // FINE), Image.Resampling.LANCZOS)

    def text(self, at: Point, text: str, size: int, colour: Colour = INK, anchor: str = "la") -> None:
        """Write a line; ``anchor`` as Pillow tells them."""
        self.pen.text(at, text, fill=colour, font=font(size), anchor=anchor)

    def halo(self, at: Point, text: str, size: int, colour: Colour = INK) -> None:
        """Write a line around a middle, legible on anything."""
        self.pen.text(at, text, fill=colour, font=font(size), anchor="mm", stroke_width=2 * FINE, stroke_fill=PAPER)

    def disc(self, at: Point, radius: float, *, fill: Colour | None = None, outline: Colour | None = None) -> None:
        """Draw a circle."""
        u, v = at
        self.pen.ellipse((u - radius, v - radius, u + radius, v + radius), fill=fill, outline=outline, width=FINE)

    def ring(self, at: Point, radius: float, colour: Colour, width: int = 1) -> None:
        """Draw the outline of a circle."""
        u, v = at
        self.pen.ellipse((u - radius, v - radius, u + radius, v + radius), outline=colour, width=width * FINE)

    def scale(self, at: Point, size: Point, stops: Sequence[Colour]) -> None:
        """Draw a strip of all colours of a scale, low ones on the left."""
        (left, top), (width, height) = at, size
        for column in range(round(width)):
            colour = blended(stops, column / max(width - 1, 1))
            self.pen.line((left + column, top, left + column, top + height), fill=colour)


def blended(stops: Sequence[Colour], share: float) -> Colour:
    """Return the colour of a scale at a share in 0..1, between its stops."""
    place = min(max(share, 0.0), 1.0) * (len(stops) - 1)
    first = min(int(place), len(stops) - 2)
    red, green, blue = (
        round(a + (b - a) * (place - first)) for a, b in zip(stops[first], stops[first + 1], strict=True)
    )
    return red, green, blue


def font(size: int) -> ImageFont.FreeTypeFont:
    """Return the font of so many pixels of the result."""
    found = ImageFont.load_default(size * FINE)
    assert isinstance(found, ImageFont.FreeTypeFont)
    return found


def wrapped(text: str, size: int, width: float) -> list[str]:
    """Return the lines of a text that are no wider than so many pixels of the sheet, broken between words."""
    lines: list[str] = []
    for word in text.split(" "):
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and font(size).getlength(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines
