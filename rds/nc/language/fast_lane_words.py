"""The words of a plain line, by compiled code. Importing this needs numba."""

from __future__ import annotations

import numpy as np
from numba import njit

from rds.nc.language.batch import FOUND
from rds.nc.language.source import LONGEST

# Where the words are put: the axes at 0 to 5, I J K at 6 to 8.
LETTERS = "xyzabcijkrfspql"
R, F, S, P, Q, L = range(9, 15)
AXES, IJK = 0b000_111111, 0b111_000000
# What else a line says, by its place in `found`; -1 for a word that is not there.
GIVEN, MOVE, DISTANCE, RETRACT, DWELLS, SPINDLE_WORD, COOLANT_WORD, N, DIGITS, SAID, SAID_SIZE = range(11)
# What a byte is, when it is not a letter with a place.
_G, _N, _M, _BLANK, _NEWLINE, _SEMICOLON, _COMMENT, _OTHER = 20, 21, 22, 30, 31, 32, 33, -1
_EXACT = 1 << 53  # whole numbers up to here are floats, and up to 10^22 powers of ten: their quotient is rounded once
_DECIMALS = 22
_N_DIGITS = 9
# Comments that the interpreter obeys begin so.
_OBEYED = ("msg,", "debug,", "print,", "log", "py", "abort,")


def _byte_table() -> np.ndarray:
    table = np.full(256, _OTHER, np.int8)
    for letters in (LETTERS, LETTERS.upper()):
        for place, letter in enumerate(letters):
            table[ord(letter)] = place
    meanings = (("gG", _G), ("nN", _N), ("mM", _M), (" \t\r", _BLANK), ("\n", _NEWLINE), (";", _SEMICOLON))
    for character, meaning in (*meanings, ("(", _COMMENT)):
        for byte in character.encode():
            table[byte] = meaning
    return table


_BYTES = _byte_table()
_POWERS = np.array([float(10**power) for power in range(_DECIMALS + 1)])
_BEGINNINGS = np.array([list(word.encode().ljust(8, b"\0")) for word in _OBEYED], np.uint8)


@njit(error_model="numpy")
def _comment_end(data, at, limit, found):
    """Where the comment that is open at `at` ends, its text noted; -1 where the interpreter is to read it."""
    begin = at
    while data[begin] == 32 or data[begin] == 9:
        begin += 1
    for word in range(len(_BEGINNINGS)):
        place = 0
        while place < 8 and _BEGINNINGS[word, place] and begin + place < limit:
            if data[begin + place] | 32 != _BEGINNINGS[word, place] | 32:
                break
            place += 1
        if place == 8 or not _BEGINNINGS[word, place]:
            return -1
    end = at
    while end < limit and data[end] != 41:
        if data[end] == 40 or data[end] > 126 or (data[end] < 32 and data[end] != 9):
            return -1
        end += 1
    if end >= limit:
        return -1
    found[SAID], found[SAID_SIZE] = (begin, end - begin) if end > at else (-1, 0)
    return end + 1


@njit(error_model="numpy")
def _put_g(value, found):
    """Note a G word. False for one that is not plain, or the second of its kind."""
    code = round(10.0 * value)
    if code != 10.0 * value:
        return False
    if code == 900 or code == 910:
        place, what = DISTANCE, 1 if code == 900 else 0
    elif code == 980 or code == 990:
        place, what = RETRACT, 1 if code == 980 else 0
    elif code == 40:
        place, what = DWELLS, 1
    elif code <= 30 or code == 730 or code == 740 or (800 <= code <= 890 and code != 870 and code != 880):
        if code % 10:
            return False
        place, what = MOVE, code
    else:
        return False
    if found[place] != -1:
        return False
    found[place] = what
    return True


@njit(error_model="numpy")
def read_words(data, at, end, words, found):
    """The words of the line at `at`, into `words` and `found`.

    Returns where the next line begins; -1: not a plain line.
    """
    for place in range(FOUND):
        found[place] = -1
    found[GIVEN] = found[N] = found[DIGITS] = 0
    given = 0
    limit = min(end, at + LONGEST + 1)
    first = True
    while at < limit:
        meaning = _BYTES[data[at]]
        at += 1
        if meaning == _BLANK:
            continue
        if meaning == _NEWLINE:
            found[GIVEN] = given
            return at
        if meaning == _SEMICOLON:
            while at < limit:
                at += 1
                if data[at - 1] == 10:
                    found[GIVEN] = given
                    return at
            return -1
        if meaning < 0:
            return -1
        if meaning == _COMMENT:
            at = _comment_end(data, at, limit, found)
            if at < 0:
                return -1
            first = False
            continue
        # a number
        mantissa, digits, decimals, point, sign = 0, 0, 0, False, 0
        while at < limit:
            byte = data[at]
            if 48 <= byte <= 57:
                mantissa = 10 * mantissa + (byte - 48)
                digits += 1
                if point:
                    decimals += 1
                if mantissa > _EXACT:
                    return -1
            elif byte == 46:
                if point:
                    return -1
                point = True
            elif byte == 43 or byte == 45:
                if sign or digits or point:
                    return -1
                sign = 1 if byte == 43 else -1
            elif _BYTES[byte] != _BLANK:
                break
            at += 1
        if digits == 0 or decimals > _DECIMALS:
            return -1
        if meaning == _N:
            if not first or sign or point or digits > _N_DIGITS:
                return -1
            found[N], found[DIGITS] = mantissa, digits
        else:
            value = mantissa / _POWERS[decimals]
            if meaning == _G:
                if sign or value > 99.0 or not _put_g(value, found):
                    return -1
            elif meaning == _M:
                place = SPINDLE_WORD if value < 6.0 else COOLANT_WORD
                if sign or not 3.0 <= value <= 9.0 or value == 6.0 or value != int(value) or found[place] != -1:
                    return -1
                found[place] = int(value)
            else:
                bit = 1 << meaning
                if given & bit:
                    return -1
                given |= bit
                words[meaning] = -value if sign < 0 else value
        first = False
    return -1  # too long, or not read to its end yet
