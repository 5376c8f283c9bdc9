"""Error against time, a panel for each scene, both axes logarithmic, as SVG."""

import math
from html import escape

WIDTH, HEIGHT = 330, 260
LEFT, TOP, GAP, BOTTOM = 58, 34, 48, 78
X = (-3, 2)  # decades of seconds
Y = (-3, -0.5)  # decades of error
COLOURS = ["#0b6e4f", "#c1440e", "#3a5fa0"]
MARKS = ["circle", "square", "triangle"]


def svg(panels, goal):
    """`panels`: lines of (seconds, error) by name, by scene."""
    width = LEFT + len(panels) * (WIDTH + GAP)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{TOP + HEIGHT + BOTTOM}" '
        f'viewBox="0 0 {width} {TOP + HEIGHT + BOTTOM}" font-family="sans-serif" font-size="12">',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for number, (name, lines) in enumerate(panels.items()):
        parts += _panel(LEFT + number * (WIDTH + GAP), name, lines, goal, number == 0)
    parts += _legend(next(iter(panels.values())))
    return "\n".join([*parts, "</svg>", ""])


def _x(left, seconds):
    return left + WIDTH * (math.log10(seconds) - X[0]) / (X[1] - X[0])


def _y(error):
    return TOP + HEIGHT * (Y[1] - math.log10(error)) / (Y[1] - Y[0])


def _text(x, y, text, anchor="middle", extra=""):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {extra}>{escape(text)}</text>'


def _rule(x0, y0, x1, y1, colour, extra=""):
    ends = f'x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}"'
    return f'<line {ends} stroke="{colour}" {extra}/>'


def _panel(left, name, lines, goal, first):
    right, bottom = left + WIDTH, TOP + HEIGHT
    parts = [_text((left + right) / 2, TOP - 12, name, extra='font-weight="bold"')]
    for decade in range(X[0], X[1] + 1):
        x = _x(left, 10.0**decade)
        parts.append(_rule(x, TOP, x, bottom, "#ddd"))
        parts.append(_text(x, bottom + 16, f"{10.0**decade:g}"))
    for error in (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2):
        y = _y(error)
        parts.append(_rule(left, y, right, y, "#ddd"))
        if first:
            parts.append(_text(left - 6, y + 4, f"{100 * error:g} %", "end"))
    y = _y(goal)
    parts.append(_rule(left, y, right, y, "#888", 'stroke-dasharray="4 3"'))
    parts.append(f'<rect x="{left}" y="{TOP}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#444"/>')
    parts.append(_text((left + right) / 2, bottom + 34, "user CPU seconds, one thread"))
    if first:
        x, y = left - 46, (TOP + bottom) / 2
        turn = f'transform="rotate(-90 {x} {y})"'
        parts.append(_text(x, y, "relative L2 error, mean of lights", extra=turn))
    for number, points in enumerate(lines.values()):
        places = [(_x(left, seconds), _y(error)) for seconds, error in points]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        parts.append(f'<polyline points="{path}" fill="none" stroke="{COLOURS[number]}" stroke-width="1.8"/>')
        parts += [_mark(number, x, y) for x, y in places]
    return parts


def _mark(number, x, y):
    fill = f'fill="{COLOURS[number]}"'
    if MARKS[number] == "circle":
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" {fill}/>'
    if MARKS[number] == "square":
        return f'<rect x="{x - 3.2:.1f}" y="{y - 3.2:.1f}" width="6.4" height="6.4" {fill}/>'
    corners = [(x, y - 4.4), (x - 4, y + 3), (x + 4, y + 3)]
    return f'<polygon points="{" ".join(f"{u:.1f},{v:.1f}" for u, v in corners)}" {fill}/>'


def _legend(lines):
    parts, x, y = [], LEFT, TOP + HEIGHT + 62
    for number, name in enumerate(lines):
        parts.append(_rule(x, y, x + 22, y, COLOURS[number], 'stroke-width="1.8"'))
        parts.append(_mark(number, x + 11, y))
        parts.append(_text(x + 28, y + 4, name, "start"))
        x += 50 + 7 * len(name)
    return parts
