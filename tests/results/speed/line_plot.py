"""A small plot of lines on logarithmic axes, as SVG text that reads well on light and on dark paper."""
import math
from xml.sax.saxutils import escape

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 560, 320, 64, 16, 30, 46
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6bb1", "#7f7f7f")
STYLE = """<style>
text { font: 12px sans-serif; fill: #222; } .grid { stroke: #ccc; } .axis { stroke: #888; }
@media (prefers-color-scheme: dark) { text { fill: #ddd; } .grid { stroke: #444; } }
</style>"""


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


def short(value):
    for limit, unit in ((1e6, "M"), (1e3, "K")):
        if value >= limit:
            return f"{value / limit:g} {unit}"
    return f"{value:g}"


def line_plot(title, x_name, y_name, lines):
    """`lines`: {name: [(x, y), ...]}, every y above 0."""
    points = [point for line in lines.values() for point in line]
    x_axis = LogAxis([x for x, _ in points], LEFT, WIDTH - RIGHT)
    y_axis = LogAxis([y for _, y in points], HEIGHT - BOTTOM, TOP)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT + 18 * len(lines)}">', STYLE,
           f'<text x="{LEFT}" y="18" font-weight="bold">{escape(title)}</text>']
    for value in y_axis.decades():
        y = y_axis.at(value)
        out.append(f'<line class="grid" x1="{LEFT}" y1="{y:.1f}" x2="{WIDTH - RIGHT}" y2="{y:.1f}"/>')
        out.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{short(value)}</text>')
    for value in sorted({x for x, _ in points}):
        x = x_axis.at(value)
        out.append(f'<line class="axis" x1="{x:.1f}" y1="{HEIGHT - BOTTOM}" x2="{x:.1f}" y2="{HEIGHT - BOTTOM + 4}"/>')
        out.append(f'<text x="{x:.1f}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">{short(value)}</text>')
    out.append(f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 8}" text-anchor="middle">{escape(x_name)}</text>')
    out.append(f'<text x="{WIDTH - RIGHT}" y="18" text-anchor="end">{escape(y_name)}</text>')
    for index, (name, line) in enumerate(lines.items()):
        color = COLORS[index % len(COLORS)]
        path = " ".join(f"{x_axis.at(x):.1f},{y_axis.at(y):.1f}" for x, y in line)
        out.append(f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="2"/>')
        out += [f'<circle cx="{x_axis.at(x):.1f}" cy="{y_axis.at(y):.1f}" r="3" fill="{color}"/>' for x, y in line]
        y = HEIGHT + 18 * index + 8
        out.append(f'<rect x="{LEFT}" y="{y - 8}" width="14" height="4" fill="{color}"/>')
        out.append(f'<text x="{LEFT + 20}" y="{y}">{escape(name)}</text>')
    return "\n".join(out + ["</svg>"]) + "\n"
