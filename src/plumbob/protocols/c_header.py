"""A format as a C11 header for the microcontroller that sends it: struct, setters, getters, and the check.

Every member is an array of bytes, so the struct has no padding and means the same on any compiler and processor.
"""

import re
from collections.abc import Iterator
from typing import Final

from plumbob.core.resources import packaged
from plumbob.core.text import visible
from plumbob.core.units import unit
from plumbob.protocols import checksum
from plumbob.protocols.encode import parities
from plumbob.protocols.field import Checksum, Field
from plumbob.protocols.format import Format, Message

_HELPERS: Final = packaged("protocols/helpers.h")

# Of C11; no member can have such a name.
_KEYWORDS: Final = (
    " auto break case char const continue default do double else enum extern float for goto if inline int long register"
    " restrict return short signed sizeof static struct switch typedef union unsigned void volatile while "
)

_CHECKS: Final = {
    checksum.SUM8: "    value += data[i];",
    checksum.SUM8_ZERO: "    value -= data[i];",
    checksum.XOR8: "    value ^= data[i];",
    checksum.SUM16: "    value += data[i];",
    checksum.SUM16_EITHER: "    value += data[i];",
    checksum.SUM16_WORDS: "    value += i % 2 ? data[i] : (uint32_t)data[i] << 8;",
    checksum.SUM16_REST: "    value = (value + (i % 2 ? data[i] : (uint32_t)data[i] << 8)) % 65535u;",
    checksum.FLETCHER16: "    first += data[i], second += first & 0xFFu, "
    "value = (first & 0xFFu) << 8 | (second & 0xFFu);",
}


def c_header(form: Format) -> str:
    """Text of the header of a format that is bound."""
    guard = f"PLUMBOB_{_name(form.name).upper()}_H"
    parts = [
        f"/* {_comment(form.title)}",
        " * Made by plumbob from its description; any change belongs there. Counts are what goes over the wire:",
        " * value = count * scale + zero, in the unit given beside each member. */",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        "#include <assert.h>",
        "#include <stdint.h>",
        "#include <string.h>",
        "",
        "#ifndef PLUMBOB_BYTES",
        "#define PLUMBOB_BYTES",
        _HELPERS.rstrip(),
        "#endif",
        "",
        *(_check_function(kind) for kind in _kinds(form)),
        *(_message(form, message) for message in form.messages),
        f"#endif /* {guard} */",
    ]
    return "\n".join(parts) + "\n"


def _kinds(form: Format) -> list[str]:
    """Checks that the format uses, those of frames inside included."""
    inner = [field.check for message in form.messages for field in message.fields]
    return list(dict.fromkeys(check.kind for check in (*inner, form.framing.checksum) if check))


def _check_name(kind: str) -> str:
    return f"plumbob_{_name(kind)}"


def _check_function(kind: str) -> str:
    how = checksum.algorithm(kind)
    mask = f"0x{(1 << how.width) - 1:X}u"
    guard = _check_name(kind).upper()
    head = [f"#ifndef {guard}", f"#define {guard}", f"/* {how.meaning} */"]
    head += [f"static inline uint32_t {_check_name(kind)}(const uint8_t *data, int size)", "{"]
    if how.code == checksum.CRC:
        return "\n".join(
            [*head, *_cyclic(how.width, how.polynomial, how.start, how.final, how.reflected), "}", "#endif", ""]
        )
    running = ["    uint32_t first = 0, second = 0;"] if how.code == checksum.FLETCHER16 else []
    loop = ["    uint32_t value = 0;", *running, "    for (int i = 0; i < size; i++)", "    " + _CHECKS[how.code]]
    return "\n".join([*head, *loop, f"    return value & {mask};", "}", "#endif", ""])


def _cyclic(width: int, polynomial: int, start: int, final: int, reflected: bool) -> list[str]:
    mask, top = (1 << width) - 1, 1 << (width - 1)
    if reflected:
        generator = int(f"{polynomial:0{width}b}"[::-1], 2)
        take, turn = "value ^= data[i];", f"value = value & 1u ? value >> 1 ^ 0x{generator:X}u : value >> 1;"
    else:
        take = f"value ^= (uint32_t)data[i] << {width - 8};"
        turn = f"value = (value & 0x{top:X}u ? value << 1 ^ 0x{polynomial:X}u : value << 1) & 0x{mask:X}u;"
    return [
        f"    uint32_t value = 0x{start:X}u;",
        "    for (int i = 0; i < size; i++) {",
        f"        {take}",
        "        for (int bit = 0; bit < 8; bit++)",
        f"            {turn}",
        "    }",
        f"    return value ^ 0x{final:X}u;",
    ]


def _message(form: Format, message: Message) -> str:
    kind = f"plumbob_{_name(form.name)}"
    if len(form.messages) > 1:
        kind += f"_{_name(message.name)}"
    lines = ["typedef struct {", *_members(form, message), f"}} {kind};", ""]
    lines += [f'static_assert(sizeof({kind}) == {message.length}, "no padding");', ""]
    lines += [line for field in message.fields if not field.derived for line in _accessors(kind, message, field)]
    return "\n".join([*lines, *_seal(form, kind, message)])


def _members(form: Format, message: Message) -> Iterator[str]:
    """Members in order of their bytes; what nothing describes is spare."""
    words: dict[int, tuple[int, str, list[str]]] = {}
    framing = form.framing
    if framing.sync and not _says_sync(message):
        starts = [f.at for f in message.fields if not f.derived]  # of several beginnings, a field may say the rest
        common = min([len(framing.sync[0]), *starts])
        words[0] = (common, "sync", [framing.sync[0][:common].hex(" ").upper()])
    if rule := framing.length_field:
        words[rule.at] = (rule.size, "length", [f"length of the frame less {rule.add}, {rule.order}-endian"])
    for field in (f for f in message.fields if not f.derived):
        meanings = words.setdefault(field.at, (field.size, _member(message, field), []))[2]
        meanings.append(_meaning(field))
    if check := framing.checksum:
        how = checksum.algorithm(check.kind)
        place = check.at + (message.length if check.at < 0 else 0)
        words[place] = (how.size, "check", [f"{how.meaning}, {check.order}-endian"])
    if framing.end:
        words[message.length - len(framing.end)] = (len(framing.end), "end", [framing.end.hex(" ").upper()])
    at = 0
    for begin in sorted(words):
        size, name, meanings = words[begin]
        if begin > at:
            yield f"    uint8_t spare_{at}[{begin - at}];"
        for meaning in meanings:
            yield f"    /* {_comment(meaning)} */"
        yield f"    uint8_t {name}[{size}];"
        at = begin + size
    if at < message.length:
        yield f"    uint8_t spare_{at}[{message.length - at}];"


def _says_sync(message: Message) -> bool:
    """Whether a field says which of several beginnings the frame has."""
    return any(field.at == 0 and not (field.fixed or field.derived) for field in message.fields)


def _member(message: Message, field: Field) -> str:
    """Name of the word that holds a field: its own, or where it begins when fields share it."""
    shared = sum(f.at == field.at and not f.derived for f in message.fields) > 1
    return f"word_{field.at}" if shared else _name(field.name)


def _meaning(f: Field) -> str:
    wide = f", {f.order}-endian" if f.size > 1 and f.type != "bcd" else ""
    bits = f", bits {f.bits[0]} to {f.bits[1]}" if f.bits else ""
    text = f"{f.name}: {f.type}{wide}{bits}"
    if f.fixed:
        return f"{text}; always {f.value}"
    if not f.physical:
        says = ", ".join(f"{code} {word}" for code, word in f.says.items())
        of = f" (of {', '.join(f.of)}: {says})" if says else ""
        return f"{text}; {f.role}{of}" + (f", {f.tick}" if f.unit else "")
    inside = unit(f.unit).quantity.value
    zero = f" + {f.raw_offset * f.scale + f.zero:.9g}" if f.raw_offset or f.zero else ""
    return f"{text}; count * {f.scale:.9g}{zero} [{inside}]" if inside != "1" else f"{text}; count * {f.scale:.9g}"


def _accessors(kind: str, message: Message, f: Field) -> Iterator[str]:
    if f.fixed:
        return
    place, name = f"f->{_member(message, f)}", _name(f.name)
    high, low = f.bits or (8 * f.size - 1, 0)
    where = f"{f.size}, {int(f.order == 'big')}, {high}, {low}"
    if f.type == "bcd":
        yield f"static inline void {kind}_set_{name}({kind} *f, int32_t counts) {{ plumbob_put_bcd({place}, counts); }}"
        yield ""
        return
    if f.type[0] == "f":
        real, uint = ("float", "uint32_t") if f.size == 4 else ("double", "uint64_t")
        yield f"static inline void {kind}_set_{name}({kind} *f, {real} value)"
        yield f"{{ {uint} bits; memcpy(&bits, &value, sizeof bits); plumbob_put({place}, {where}, bits); }}"
        yield f"static inline {real} {kind}_get_{name}(const {kind} *f)"
        yield f"{{ {uint} bits = ({uint})plumbob_get({place}, {where}); {real} value; "
        yield "  memcpy(&value, &bits, sizeof value); return value; }"
        yield ""
        return
    yield f"static inline void {kind}_set_{name}({kind} *f, int64_t counts)"
    yield f"{{ plumbob_put({place}, {where}, (uint64_t)counts); }}"
    yield f"static inline int64_t {kind}_get_{name}(const {kind} *f)"
    sign = f"(counts ^ {_hex(f.width - 1)}) - {_hex(f.width - 1)}" if f.signed and f.width < 64 else "counts"
    yield f"{{ int64_t counts = (int64_t)plumbob_get({place}, {where}); return {sign}; }}"
    yield ""


def _hex(bit: int) -> str:
    return f"INT64_C(0x{1 << bit:X})"


def _seal(form: Format, kind: str, message: Message) -> Iterator[str]:
    """Function that sets what is the same in every frame, then parities, then the check."""
    framing = form.framing
    yield "/* Call it last: sets what begins every frame, constants, parities and the check. */"
    yield f"static inline void {kind}_seal({kind} *f)"
    yield "{"
    yield "    uint8_t *at = (uint8_t *)f;"
    if framing.sync and not _says_sync(message):
        yield from (f"    at[{i}] = 0x{byte:02X};" for i, byte in enumerate(framing.sync[0]))
    if rule := framing.length_field:
        big = int(rule.order == "big")
        bits = 8 * rule.size - 1
        yield f"    plumbob_put(at + {rule.at}, {rule.size}, {big}, {bits}, 0, {message.length - rule.add});"
    for f in (f for f in message.fields if f.fixed):
        high, low = f.bits or (8 * f.size - 1, 0)
        big = int(f.order == "big")
        yield f"    plumbob_put(at + {f.at}, {f.size}, {big}, {high}, {low}, {f.value & (1 << f.width) - 1}u);"
    for start, stop, bit in parities(form, message):
        yield f"    plumbob_set_odd(at + {start}, {stop - start}, {bit});"
    yield from (_put_check(field.check, field.at, field.size) for field in message.fields if field.check)
    if framing.checksum:
        yield _put_check(framing.checksum, 0, message.length)
    yield from (
        f"    at[{message.length - len(framing.end) + i}] = 0x{byte:02X};" for i, byte in enumerate(framing.end)
    )
    yield "    (void)at;"
    yield "}"
    yield ""


def _put_check(check: Checksum, begin: int, length: int) -> str:
    size = checksum.algorithm(check.kind).size
    stop = check.stop + (length if check.stop <= 0 else 0)
    at = begin + check.at + (length if check.at < 0 else 0)
    value = f"{_check_name(check.kind)}(at + {begin + check.start}, {stop - check.start})"
    return f"    plumbob_put(at + {at}, {size}, {int(check.order == 'big')}, {8 * size - 1}, 0, {value});"


def _comment(text: str) -> str:
    """Text inside a comment, which it cannot end: it comes from a file that anybody may have written."""
    return visible(text).replace("*/", "* /").replace("/*", "/ *")


def _name(text: str) -> str:
    """Identifier of C."""
    made = re.sub(r"\W", "_", text)
    made = f"_{made}" if made[:1].isdigit() else made
    return f"{made}_" if f" {made} " in _KEYWORDS else made
