"""A block diagram as SVG, in the page's own colours."""

from __future__ import annotations

from html import escape

from rds.panels.equipment.diagram import Block, Diagram, Link

_WIDTH, _GAP, _ROW, _TOP = 130, 56, 104, 12  # px
_LINE = 16  # px of text
_HEIGHT = 84
_MARGIN = 24  # to the right of the last block, for the feedback
_LONGEST = 20  # characters of a line


def diagram_svg(diagram: Diagram) -> str:
    """The diagram as an SVG element that is as wide as its place, with its sentence for who cannot see it."""
    columns = 1 + max(block.column for block in diagram.blocks)
    rows = 1 + max(block.row for block in diagram.blocks)
    width = columns * (_WIDTH + _GAP) - _GAP + 4 + _MARGIN
    height = _TOP + rows * _ROW + (34 if any(link.back for link in diagram.links) else 0)
    at = {block.name: block for block in diagram.blocks}
    drawn = [_link(link, at[link.start], at[link.end], rows) for link in diagram.links]
    drawn += [_block(block) for block in diagram.blocks]
    return (
        f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{escape(diagram.sentence)}" '
        f'style="width: 100%; max-width: {width}px; height: auto" font-size="13" fill="var(--rds-text)">'
        f"{''.join(drawn)}</svg>"
    )


def _place(block: Block) -> tuple[int, int]:
    return 4 + block.column * (_WIDTH + _GAP), _TOP + block.row * _ROW


def _block(block: Block) -> str:
    x, y = _place(block)
    dash = ' stroke-dasharray="5 4"' if block.quiet else ""
    box = (
        f'<rect x="{x}" y="{y}" width="{_WIDTH}" height="{_HEIGHT}" rx="6" fill="var(--rds-surface)" '
        f'stroke="var(--rds-accent)" stroke-width="1.5"{dash}/>'
    )
    middle = x + _WIDTH / 2
    texts = [_text(middle, y + 20, block.title, 'font-weight="600"')]
    texts += [
        _text(middle, y + 20 + _LINE * (i + 1), line, 'font-size="12" fill="var(--rds-quiet)"')
        for i, line in enumerate(block.lines)
    ]
    return box + "".join(texts)


def _text(x: float, y: float, text: str, style: str) -> str:
    short = text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
    return f'<text x="{x:g}" y="{y:g}" text-anchor="middle" {style}>{escape(short)}<title>{escape(text)}</title></text>'


def _link(link: Link, start: Block, end: Block, rows: int) -> str:
    (x0, y0), (x1, y1) = _place(start), _place(end)
    head = f"M{x1 - 8} {y1 + _HEIGHT / 2 - 4:g}l8 4l-8 4z"  # to the right, into the block
    if link.back or end.row < start.row:
        head = f"M{x1 + _WIDTH / 2 - 4:g} {y1 + _HEIGHT + 8}l4 -8l4 8z"  # up, from under it
    if link.back:
        low = _TOP + rows * _ROW + 6
        # a little to the right of the middle, where nothing of a second row ends
        right, left = x0 + _WIDTH + _MARGIN - 6, x1 + _WIDTH / 2  # around what stands under the block
        path = f"M{x0 + _WIDTH} {y0 + _HEIGHT / 2:g}H{right}V{low}H{left:g}V{y1 + _HEIGHT}"
        label = _text((right + left) / 2, low + 16, link.label, "")
    elif start.row == end.row:
        middle = y0 + _HEIGHT / 2
        path = f"M{x0 + _WIDTH} {middle:g}H{x1}"
        label = _text((x0 + _WIDTH + x1) / 2, middle - 7, link.label, "")
    elif end.row < start.row:  # from the second row back up, to under the block
        under = x1 + _WIDTH / 2
        path = f"M{x0 + _WIDTH} {y0 + _HEIGHT / 2:g}H{under:g}V{y1 + _HEIGHT}"
        label = _text((x0 + _WIDTH + under) / 2, y0 + _HEIGHT / 2 - 7, link.label, "")
    else:
        down = y1 + _HEIGHT / 2
        path = f"M{x0 + _WIDTH / 2:g} {y0 + _HEIGHT}V{down:g}H{x1}"
        label = _text(x0 + _WIDTH / 2 + 8, down + 18, link.label, "")
    # no marker: browsers draw none whose definition is in a panel out of sight, where one of the same name may stand
    return f'<path d="{path}" fill="none" stroke="var(--rds-text)"/><path d="{head}" fill="var(--rds-text)"/>{label}'
