"""Plots as SVG text that reads well on light and on dark paper. Equal input gives equal bytes."""
import math
from xml.sax.saxutils import escape

# Distinct for colour-blind readers too (after Okabe and Ito).
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6bb1", "#7f7f7f")
STYLE = """<style>
text { font: 12px sans-serif; fill: #222; } .title { font-weight: bold; } .faint { fill: #656d76; font-size: 11px; }
.grid { stroke: #ccc; } .axis { stroke: #888; }
@media (prefers-color-scheme: dark) { text { fill: #ddd; } .grid { stroke: #444; } .faint { fill: #9198a1; } }
</style>"""


def document(width, height, parts):
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}">'
    return "\n".join([head, STYLE] + parts + ["</svg>"]) + "\n"


def text(x, y, words, anchor="start", style=""):
    return f'<text class="{style}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>'


def line(x1, y1, x2, y2, style):
    return f'<line class="{style}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'


def polyline(points, colour, width):
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width}"/>'


def rectangle(x, y, width, height, colour):
    return f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" fill="{colour}"/>'


def short(value):
    for limit, unit in ((1e6, "M"), (1e3, "K")):
        if value >= limit:
            return f"{value / limit:.3g} {unit}"
    return f"{value:.3g}"


# ---- bars ----

def bar_plot(title, groups):
    """`groups`: {group: {bar: value}}. Every bar has the colour of its place among all bars."""
    left, top, height, gap, width = 130, 52, 13, 16, 560
    names = list(dict.fromkeys(name for bars in groups.values() for name in bars))
    greatest = max(value for bars in groups.values() for value in bars.values()) or 1.0
    out, y = [text(20, 28, title, style="title")], top
    for group, bars in groups.items():
        out.append(text(left - 10, y + 11, group, "end"))
        for name, value in bars.items():
            length = width * value / greatest
            out.append(rectangle(left, y, max(length, 0.5), height - 3, COLOURS[names.index(name) % len(COLOURS)]))
            out.append(text(left + length + 6, y + 9, f"{short(value)}  {name}", style="faint"))
            y += height
        y += gap
    return document(left + width + 210, y, out)


# ---- strips over time ----

def strip_plot(title, unit, strips):
    """One strip below another over one axis of time; `strips`: {name: (note, [(seconds, value), ...])}, values from 0."""
    left, top, width, height, gap = 70, 40, 720, 56, 24
    points = [point for _, strip in strips.values() for point in strip]
    last_s, greatest = max(t for t, _ in points) or 1.0, max(value for _, value in points) or 1.0
    out = [text(left, 22, title, style="title")]
    for index, (name, (note, strip)) in enumerate(strips.items()):
        bottom = top + index * (height + gap) + height
        at = lambda t, value: (left + width * t / last_s, bottom - height * value / greatest)
        out += [line(left, bottom - height * share, left + width, bottom - height * share, "grid") for share in (0, 0.5, 1)]
        out += [text(left - 8, bottom - height + 5, f"{short(greatest)} {unit}", "end", "faint"), text(left - 8, bottom + 3, "0", "end", "faint")]
        out.append(polyline([at(t, value) for t, value in strip], COLOURS[index % len(COLOURS)], 1.4))
        out += [text(left + width + 10, bottom - height + 16, name), text(left + width + 10, bottom - height + 33, note, style="faint")]
    bottom = top + len(strips) * (height + gap) - gap
    step = max(1, math.ceil(last_s / 10))
    for t in range(0, math.floor(last_s) + 1, step):
        x = left + width * t / last_s
        out += [line(x, bottom, x, bottom + 5, "axis"), text(x, bottom + 20, f"{t} s", "middle", "faint")]
    return document(left + width + 170, bottom + 30, out)


# ---- lines on logarithmic axes ----

class LogAxis:
    """Positions along one side; a value of 0 stands at the low end, as half the least other one."""

    def __init__(self, values, first, last):
        positive = [value for value in values if value > 0]
        self.zero = min(positive) / 2 if min(values) <= 0 else None
        low = math.log10(self.zero or min(positive))
        high = math.log10(max(positive))
        self.low, self.high = (low, high) if high - low > 0.3 else (low - 0.15, high + 0.15)
        self.first, self.last = first, last

    def at(self, value):
        log = math.log10(value if value > 0 else self.zero)
        return self.first + (self.last - self.first) * (log - self.low) / (self.high - self.low)

    def decades(self):
        return [10.0**k for k in range(math.ceil(self.low), math.floor(self.high) + 1)]


def line_plot(title, x_name, y_name, lines):
    """`lines`: {name: [(x, y), ...]}, every y above 0."""
    width, height, left, right, top, bottom = 560, 320, 64, 16, 30, 46
    points = [point for one in lines.values() for point in one]
    x_axis = LogAxis([x for x, _ in points], left, width - right)
    y_axis = LogAxis([y for _, y in points], height - bottom, top)
    out = [text(left, 18, title, style="title")]
    for value in y_axis.decades():
        y = y_axis.at(value)
        out += [line(left, y, width - right, y, "grid"), text(left - 6, y + 4, short(value), "end")]
    for value in sorted({x for x, _ in points}):
        x = x_axis.at(value)
        out += [line(x, height - bottom, x, height - bottom + 4, "axis"), text(x, height - bottom + 18, short(value), "middle")]
    out += [text((left + width - right) / 2, height - 8, x_name, "middle"), text(width - right, 18, y_name, "end")]
    for index, (name, one) in enumerate(lines.items()):
        colour, y = COLOURS[index % len(COLOURS)], height + 18 * index + 8
        out.append(polyline([(x_axis.at(x), y_axis.at(y)) for x, y in one], colour, 2))
        out += [f'<circle cx="{x_axis.at(x):.1f}" cy="{y_axis.at(y):.1f}" r="3" fill="{colour}"/>' for x, y in one]
        out += [rectangle(left, y - 8, 14, 4, colour), text(left + 20, y, name)]
    return document(width, height + 18 * len(lines), out)
