"""Bytes of a text file to text: the encoding in which its words are words.

A few letters of a title do not tell an encoding by their statistics (charset-normalizer takes
'time µs' in Latin-1 for 'time ”s', and six of twelve short titles wrong); words that name times,
places and units do. Digits and separators are the same in all of them.
"""

import re
from pathlib import Path

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.titles import count_words

MAX_BYTES = 64_000_000  # about a million rows of six numbers
MARKS = (
    (b"\xef\xbb\xbf", "utf-8-sig"),
    (b"\xff\xfe\x00\x00", "utf-32"),
    (b"\x00\x00\xfe\xff", "utf-32"),
    (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
)
ENCODINGS = (
    *("cp1252", "gb18030", "shift_jis", "big5", "euc_kr", "euc_jp"),
    *("cp1251", "cp1250", "cp1253", "cp1254", "mac_roman", "koi8_r", "cp437"),
)
HEAD_BYTES = 4096  # titles are at the top
# Of East Asian keyboards: as wide as a character, and else the same.
FULL_WIDTH = {wide: wide - 0xFEE0 for wide in range(0xFF01, 0xFF5F)} | {0x3000: " "}


def content_of(path: Path) -> bytes:
    """The bytes of a file.

    Raises:
      InputError: it cannot be read, is empty, or is larger than `MAX_BYTES`.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise InputError("no such file") from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}") from None
    if len(content) > MAX_BYTES:
        raise InputError(f"larger than {MAX_BYTES // 1_000_000} MB; a table of one motion expected")
    if not content.strip(b" \t\r\n\0"):
        raise InputError("empty; a row of titles and numbers expected")
    return content


def decoded(content: bytes) -> str:
    """The text of a file: of the encodings of old systems the one in which most words are known.

    Raises:
      InputError: it is no text.
    """
    for mark, encoding in MARKS:
        if content.startswith(mark):
            return _text(content.decode(encoding, errors="replace"))
    if b"\0" in content:
        return _without_mark(content)
    try:
        return _text(content.decode("utf-8"))
    except UnicodeDecodeError:
        pass
    head = content[:HEAD_BYTES].rpartition(b"\n")[0] or content[:HEAD_BYTES]
    best, most = ENCODINGS[0], (-1, 0.0)
    for encoding in ENCODINGS:
        try:
            text = head.decode(encoding).translate(FULL_WIDTH)
        except UnicodeDecodeError:
            continue
        beyond = [letter for letter in text if letter > "\x7f"]
        share = sum(map(str.isalpha, beyond)) / len(beyond) if beyond else 0.0
        if (found := (count_words(text), share)) > most:
            best, most = encoding, found
    return _text(content.decode(best, errors="replace"))


def _without_mark(content: bytes) -> str:
    """UTF-16 without its mark: every second byte of digits is 0."""
    even, odd = content[0:HEAD_BYTES:2], content[1:HEAD_BYTES:2]
    for encoding, nulls, other in (("utf-16-le", odd, even), ("utf-16-be", even, odd)):
        if nulls.count(0) > 0.8 * len(nulls) and other.count(0) < 0.1 * len(other):
            return _text(content.decode(encoding, errors="replace"))
    raise InputError(f"not a text: a byte 0 at {content.index(0)}; a table expected")


def _text(text: str) -> str:
    """The text in letters of the usual width, unless it is full of what no table has."""
    strange = re.findall(r"[\x01-\x08\x0e-\x1a\x1c-\x1f\x7f]", text[:HEAD_BYTES])
    if len(strange) > 0.02 * len(text[:HEAD_BYTES]):
        raise InputError("not a text, full of control characters; a table expected")
    return text.translate(FULL_WIDTH)
